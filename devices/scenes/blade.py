"""A piece of blade: a flat or gently bulging strip with two tapering edges and perhaps a tip, in the left camera's
frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.scenes.settings import SceneSettings

Array = NDArray[Any]  # of floats


@dataclass(frozen=True)
class BladePiece:
    """Surface points are `origin + s * along + n * across - curvature * (n - centre)² * normal`.

    `normal` points toward the camera, `along` to the tip. The outline is |n - centre| ≤ half width(s), closed at the
    tip.
    """

    settings: SceneSettings

    @cached_property
    def normal(self) -> Array:
        right, down = self.settings.tilt
        normal = np.array([-1.0, right, down])
        return np.asarray(normal / np.linalg.norm(normal))

    @cached_property
    def along(self) -> Array:
        direction = np.array([0.0, np.cos(self.settings.angle), np.sin(self.settings.angle)])
        right, down = self.settings.tilt
        direction[0] = right * direction[1] + down * direction[2]
        return np.asarray(direction / np.linalg.norm(direction))

    @cached_property
    def across(self) -> Array:
        """Unit vector in the surface to the right of `along` as the camera sees it: image angle + 90°."""
        return np.cross(self.along, self.normal)

    @cached_property
    def origin(self) -> Array:
        return np.array([self.settings.distance_m, 0.0, 0.0])

    def half_widths(self, s: Array) -> tuple[Array, Array]:
        """Distances of the edges from the middle line at stations s, on the +across and the -across side."""
        half = self.settings.chord_m / 2
        return half + self.settings.taper[0] * s, half + self.settings.taper[1] * s

    @property
    def tip_length(self) -> float:
        """Length over which the outline closes toward the tip."""
        lengths = {"round": 0.45, "square": 0.0, "spike": 0.8}
        return lengths[self.settings.tip_shape] * self.settings.chord_m

    def point(self, s: Array, n: Array) -> Array:
        """Surface points (…, 3) at surface coordinates."""
        bulge = self.settings.curvature * (n - self.settings.centre_m) ** 2
        return (
            self.origin
            + np.multiply.outer(s, self.along)
            + np.multiply.outer(n, self.across)
            - np.multiply.outer(bulge, self.normal)
        )

    def meet(self, eye: Array, rays: Array) -> tuple[Array, Array, Array]:
        """(t, s, n) where `eye + t * rays` (…, 3) first meets the surface; t is NaN where it does not."""
        kappa = self.settings.curvature
        start = eye - self.origin
        h0, h1 = float(start @ self.normal), rays @ self.normal.astype(rays.dtype)
        n0, n1 = float(start @ self.across) - self.settings.centre_m, rays @ self.across.astype(rays.dtype)
        with np.errstate(invalid="ignore", divide="ignore"):
            if kappa == 0:
                t = -h0 / h1
            else:
                a, b, c = kappa * n1 * n1, 2 * kappa * n0 * n1 + h1, kappa * n0 * n0 + h0
                t = 2 * c / (-b + np.sqrt(b * b - 4 * a * c))
            t = np.where(t > 0, t, np.nan)
            s = float(start @ self.along) + t * (rays @ self.along.astype(rays.dtype))
            n = n0 + t * n1 + self.settings.centre_m
        return t, s, n

    def inside(self, s: Array, n: Array) -> Array:
        """Positive inside the outline, zero on it, in metres from it near by."""
        offset = n - self.settings.centre_m
        right, left = self.half_widths(s)
        value = np.minimum(right - offset, left + offset)
        tip = self.settings.tip_m
        if tip is None:
            return value
        if self.settings.tip_shape == "square":
            return np.minimum(value, tip - s)
        length = self.tip_length
        begin = tip - length
        right, left = self.half_widths(np.asarray(begin))
        side = np.where(offset > 0, right, left)
        with np.errstate(invalid="ignore"):
            if self.settings.tip_shape == "round":
                closed = (1 - np.hypot(offset / side, (s - begin) / length)) * np.minimum(side, length)
            else:
                closed = (1 - np.abs(offset) / side - (s - begin) / length) * np.minimum(side, length)
        return np.where(s > begin, closed, value)
