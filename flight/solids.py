"""Solids with signed distances: what the keep-out volume is made of. They are asked point by point along a way, where
plain floats are ten times as fast as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import dist, hypot, inf, sqrt
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


Point = tuple[float, float, float]


class Solid(Protocol):
    """Anything that knows how far a point (north, east, down) of local NED is from its surface."""

    def distance(self, point: Point) -> float:
        """Signed distance in metres, negative inside."""
        ...

    def normal(self, point: Point) -> Array:
        """The unit direction (3,) in which the distance grows most."""
        ...


@dataclass(frozen=True)
class Revolved:
    """A polygon turned about an axis, rounded outward by `growth_m`.

    origin (3,) and unit axis (3,) in local NED; corners: (along the axis, radius ≥ 0) in metres, a closed simple
    polygon.
    """

    origin: Array
    axis: Array
    corners: tuple[tuple[float, float], ...]
    growth_m: float

    @cached_property
    def _floats(self) -> tuple[Point, Point]:
        (a, b, c), (d, e, f) = self.origin.tolist(), self.axis.tolist()
        return (a, b, c), (d, e, f)

    @cached_property
    def _edges(self) -> tuple[_Edge, ...]:
        return _edges(self.corners)

    def _meridian(self, point: Point) -> tuple[float, float]:
        """The point as (along the axis, radius)."""
        (ox, oy, oz), (ax, ay, az) = self._floats
        x, y, z = point[0] - ox, point[1] - oy, point[2] - oz
        along = x * ax + y * ay + z * az
        return along, sqrt(max(x * x + y * y + z * z - along * along, 0.0))

    def distance(self, point: Point) -> float:
        return _polygon(self._edges, *self._meridian(point))[0] - self.growth_m

    def normal(self, point: Point) -> Array:
        along, radius = self._meridian(point)
        outward = np.array(point) - self.origin - along * self.axis
        radial = outward / radius if radius > 1e-6 else _any_normal(self.axis)
        gradient = _polygon(self._edges, along, radius)[1]
        return gradient[0] * self.axis + gradient[1] * radial


@dataclass(frozen=True)
class Ball:
    """A sphere: centre (3,) in local NED."""

    centre: Array
    radius_m: float

    @cached_property
    def _centre(self) -> Point:
        a, b, c = self.centre.tolist()
        return a, b, c

    def distance(self, point: Point) -> float:
        return dist(point, self._centre) - self.radius_m

    def normal(self, point: Point) -> Array:
        offset = np.array(point) - self.centre
        length = float(np.linalg.norm(offset))
        return offset / length if length > 1e-9 else np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Box:
    """A box rounded outward by `growth_m`: centre (3,) and rotation (3, 3), its axes as columns, in local NED."""

    centre: Array
    rotation: Array
    half: Array
    growth_m: float

    @cached_property
    def _floats(self) -> tuple[list[float], list[list[float]], list[float]]:
        return self.centre.tolist(), self.rotation.T.tolist(), self.half.tolist()

    def distance(self, point: Point) -> float:
        (cx, cy, cz), axes, half = self._floats
        x, y, z = point[0] - cx, point[1] - cy, point[2] - cz
        excess = [abs(x * a + y * b + z * c) - h for (a, b, c), h in zip(axes, half, strict=True)]
        u, v, w = (max(e, 0.0) for e in excess)
        outside = sqrt(u * u + v * v + w * w)
        return (outside if outside > 0.0 else max(excess)) - self.growth_m

    def normal(self, point: Point) -> Array:
        local = (np.array(point) - self.centre) @ self.rotation
        excess = np.abs(local) - self.half
        outside = np.maximum(excess, 0.0)
        length = float(np.linalg.norm(outside))
        sign = np.where(local < 0, -1.0, 1.0)
        face = int(np.argmax(excess))
        result: Array = (
            self.rotation @ (sign * outside / length) if length > 1e-9 else sign[face] * self.rotation[:, face]
        )
        return result


def _any_normal(axis: Array) -> Array:
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    normal = np.cross(axis, other)
    result: Array = normal / np.linalg.norm(normal)
    return result


_Edge = tuple[float, float, float, float, float, float, float, bool]


def _edges(corners: Sequence[tuple[float, float]]) -> tuple[_Edge, ...]:
    """Per edge: start, extent, squared length, unit outward normal, and whether it is a surface: an edge on the axis of
    revolution is none."""
    pairs = [(a, b) for a, b in zip((corners[-1], *corners[:-1]), corners, strict=True) if a != b]
    turn = 1.0 if sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) > 0 else -1.0
    edges = []
    for (ax, ay), (bx, by) in pairs:
        ex, ey = bx - ax, by - ay
        length = hypot(ex, ey)
        on_axis = ay <= 1e-12 and by <= 1e-12
        edges.append((ax, ay, ex, ey, length * length, turn * ey / length, -turn * ex / length, not on_axis))
    return tuple(edges)


def _polygon(edges: Sequence[_Edge], x: float, y: float) -> tuple[float, tuple[float, float]]:
    """Signed distance of (x, y) to a polygon and its gradient, by the nearest edge and an even-odd count of
    crossings."""
    best, nearest, outward, inside = inf, (0.0, 0.0), (1.0, 0.0), False
    for ax, ay, ex, ey, squared, nx, ny, surface in edges:
        dx, dy = x - ax, y - ay
        if (dy < 0.0) != (dy < ey) and dx < ex * dy / ey:
            inside = not inside
        if not surface:
            continue
        share = (dx * ex + dy * ey) / squared
        share = 0.0 if share < 0.0 else min(share, 1.0)
        rx, ry = dx - share * ex, dy - share * ey
        distance = rx * rx + ry * ry
        if distance < best:
            best, nearest, outward = distance, (rx, ry), (nx, ny)
    best = sqrt(best)
    if best < 1e-9:
        return 0.0, outward
    sign = -1.0 if inside else 1.0
    return sign * best, (sign * nearest[0] / best, sign * nearest[1] / best)
