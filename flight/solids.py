"""Solids with signed distances: what the keep-out volume is made of. Plain floats, since they are asked point by
point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Solid(Protocol):
    """Anything that knows how far a point of local NED is from its surface."""

    def probe(self, point: Array) -> tuple[float, Array]:
        """Signed distance (m, negative inside) and the unit direction (3,) of its steepest growth."""
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

    def probe(self, point: Array) -> tuple[float, Array]:
        offset = point - self.origin
        along = float(offset @ self.axis)
        outward = offset - along * self.axis
        radius = float(np.sqrt(outward @ outward))
        radial = outward / radius if radius > 1e-9 else _any_normal(self.axis)
        distance, gradient = _polygon(self.corners, along, radius)
        return distance - self.growth_m, gradient[0] * self.axis + gradient[1] * radial


@dataclass(frozen=True)
class Ball:
    """A sphere: centre (3,) in local NED."""

    centre: Array
    radius_m: float

    def probe(self, point: Array) -> tuple[float, Array]:
        offset = point - self.centre
        length = float(np.sqrt(offset @ offset))
        return length - self.radius_m, offset / length if length > 1e-9 else np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True)
class Box:
    """A box rounded outward by `growth_m`: centre (3,) and rotation (3, 3), its axes as columns, in local NED."""

    centre: Array
    rotation: Array
    half: Array
    growth_m: float

    def probe(self, point: Array) -> tuple[float, Array]:
        local = (point - self.centre) @ self.rotation
        excess = np.abs(local) - self.half
        outside = np.maximum(excess, 0.0)
        length = float(np.sqrt(outside @ outside))
        sign = np.where(local < 0, -1.0, 1.0)
        if length > 1e-9:
            return length - self.growth_m, self.rotation @ (sign * outside / length)
        face = int(np.argmax(excess))
        return float(excess[face]) - self.growth_m, sign[face] * self.rotation[:, face]


def _any_normal(axis: Array) -> Array:
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    normal = np.cross(axis, other)
    result: Array = normal / np.linalg.norm(normal)
    return result


def _polygon(corners: Sequence[tuple[float, float]], x: float, y: float) -> tuple[float, tuple[float, float]]:
    """Signed distance of (x, y) to a polygon and its gradient, by the nearest edge and an even-odd count of
    crossings."""
    best, nearest, edge_normal, inside = float("inf"), (0.0, 0.0), (1.0, 0.0), False
    area = 0.0
    previous = corners[-1]
    for corner in corners:
        (ax, ay), (bx, by) = previous, corner
        previous = corner
        ex, ey = bx - ax, by - ay
        area += ax * by - bx * ay
        length = ex * ex + ey * ey
        if length == 0.0:
            continue
        if (ay > y) != (by > y) and x < ax + ex * (y - ay) / ey:
            inside = not inside
        if ay <= 1e-12 and by <= 1e-12:
            continue  # an edge on the axis of revolution is no surface
        share = min(max(((x - ax) * ex + (y - ay) * ey) / length, 0.0), 1.0)
        px, py = ax + share * ex, ay + share * ey
        distance = hypot(x - px, y - py)
        if distance < best:
            best, nearest, edge_normal = distance, (px, py), (ey, -ex)
    sign = -1.0 if inside else 1.0
    if best > 1e-9:
        return sign * best, (sign * (x - nearest[0]) / best, sign * (y - nearest[1]) / best)
    turn = (1.0 if area > 0 else -1.0) / hypot(*edge_normal)
    return 0.0, (edge_normal[0] * turn, edge_normal[1] * turn)
