"""Fits the blade's surface: inverse depth is linear in the image for a plane, and bends gently for a blade."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.surface_kernels import fit

Array = NDArray[Any]  # of floats

LARGEST_BEND = 0.06  # relative change of inverse depth from the plane through a blade's dots
BENT_OTHERWISE = 0.2  # of a surface's bend, by which it is no parabola
NOWHERE = 1e3  # 1/m, sigma of what does not count
SLOPE, BEND = 0.35, 3.0  # of a blade's surface: relative change of inverse depth per image unit at focal length one
SPREAD = np.array([1e3, SLOPE, SLOPE, BEND, BEND, BEND])  # of the terms, over the inverse depth


@dataclass(frozen=True)
class Surface:
    """A plane in the left camera's frame, depth = depth_m + slope · (y, z), with its covariance (3, 3) in that order.

    inliers (n,): the points that agree. bent: a gently curved surface fits clearly better, and `depth_m` and the
    slopes are its tangent where the optical axis meets it. coefficients (6,): inverse depth over (1, y, z, y², yz,
    z²) of the image at focal length one; the last three are zero for a plane.
    """

    depth_m: float
    slope: Array
    covariance: Array
    coefficients: Array
    inliers: NDArray[np.bool_]
    bent: bool

    @property
    def normal(self) -> Array:
        """Unit normal (3,) toward the camera."""
        normal = np.array([-1.0, *self.slope])
        return np.asarray(normal / np.linalg.norm(normal))

    def inverse_depth(self, rays: Array) -> Array:
        """Inverse depth (n,) along rays (n, 3) with x = 1."""
        result: Array = _terms(rays) @ self.coefficients
        return result

    def nearest_m(self, rays: Array) -> float:
        """Distance from the lens to the nearest place of the surface on rays (n, 3) with x = 1, those of its dots: the
        nearest of the dots' own places would be the one with the largest error."""
        return float((np.linalg.norm(rays, axis=1) / self.inverse_depth(rays)).min())


def _terms(rays: Array) -> Array:
    """1, y, z, y², yz, z² (n, 6) of rays (n, 3)."""
    terms = np.empty((len(rays), 6))
    terms[:, 0], terms[:, 1:3] = 1.0, rays[:, 1:]
    np.multiply(rays[:, 1:], rays[:, 1:2], out=terms[:, 3:5])
    np.multiply(rays[:, 2], rays[:, 2], out=terms[:, 5])
    return terms


def fit_surface(rays: Array, inverse_depth: Array, sigma: Array) -> Surface | None:
    """The surface through points at inverse depths (n,) along rays (n, 3), sigmas (n,) of the inverse depths.

    Robust against some wrong points. Where all lie on one line, the slope across it is what a blade's surface usually
    has (SLOPE), with that uncertainty. None with fewer than four points.
    """
    if len(rays) < 4:
        return None
    rays, inverse_depth, sigma = (np.ascontiguousarray(values) for values in (rays, inverse_depth, sigma))
    coefficients, covariance, inliers = np.empty(6), np.empty((3, 3)), np.empty(len(rays), np.bool_)
    limits = LARGEST_BEND, BENT_OTHERWISE, NOWHERE
    bent = fit(rays, inverse_depth, sigma, SLOPE, SPREAD, limits, coefficients, covariance, inliers)
    a, b, c = coefficients[:3].tolist()
    if a <= 0:
        return None
    jacobian = np.array([[-1 / a**2, 0, 0], [b / a**2, -1 / a, 0], [c / a**2, 0, -1 / a]])
    return Surface(1 / a, np.array([-b / a, -c / a]), jacobian @ covariance @ jacobian.T, coefficients, inliers, bent)
