"""Fits the blade's surface: inverse depth is linear in the image for a plane, and bends gently for a blade."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """A plane in the left camera's frame, depth = depth_m + slope · (y, z), with its covariance (3, 3) in that order.

    inliers (n,): the points that agree. bent: a gently curved surface fits clearly better, and `depth_m` and the slopes are
    its tangent where the optical axis meets it. coefficients (6,): inverse depth over (1, y, z, y², yz, z²) of the image at
    focal length one; the last three are zero for a plane.
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
        return normal / np.linalg.norm(normal)

    def inverse_depth(self, rays: Array) -> Array:
        """Inverse depth (n,) along rays (n, 3) with x = 1."""
        result: Array = _terms(rays, 6) @ self.coefficients
        return result


def _terms(rays: Array, count: int) -> Array:
    y, z = rays[:, 1], rays[:, 2]
    return np.stack([np.ones_like(y), y, z, y * y, y * z, z * z][:count], axis=1)


def fit_surface(rays: Array, inverse_depth: Array, sigma: Array) -> Surface | None:
    """The surface through points at inverse depths (n,) along rays (n, 3), sigmas (n,) of the inverse depths.

    Robust against some wrong points. None with fewer than four points or with all of them on one line, where the slope
    across it is free.
    """
    if len(rays) < 4:
        return None
    spread = np.linalg.eigvalsh(np.cov(rays[:, 1:].T))
    if spread[0] < (4.0 / 616) ** 2:
        return None
    # A point may stand off its neighbours by a little relief of the surface, which no sensor noise explains.
    relief = np.hypot(sigma, 0.002 * inverse_depth)
    flat, flat_weight, flat_cost = _robust(_terms(rays, 3), inverse_depth, relief)
    coefficients, weight, count, bent = np.r_[flat, 0, 0, 0], flat_weight, 3, False
    if len(rays) >= 16:
        curved, curved_weight, curved_cost = _robust(_terms(rays, 6), inverse_depth, relief)
        free = len(rays) - 6
        reach = np.hypot(rays[:, 1], rays[:, 2]).min()
        if (flat_cost - curved_cost) / 3 > 6 * max(curved_cost / free, 1.0) and reach < 0.08:
            coefficients, weight, count, bent = curved, curved_weight, 6, True
    design = _terms(rays, count)
    information = (design * weight[:, None]).T @ design
    covariance = np.linalg.inv(information)[:3, :3]
    residual = (inverse_depth - design @ coefficients[:count]) / relief
    inliers = np.abs(residual) < 5
    freedom = max(int(inliers.sum()) - count, 1)
    covariance *= max(1.0, float((residual[inliers] ** 2).sum()) / freedom)
    a, b, c = coefficients[:3]
    if a <= 0:
        return None
    jacobian = np.array([[-1 / a**2, 0, 0], [b / a**2, -1 / a, 0], [c / a**2, 0, -1 / a]])
    return Surface(1 / a, np.array([-b / a, -c / a]), jacobian @ covariance @ jacobian.T, coefficients, inliers, bent)


def _robust(design: Array, values: Array, sigma: Array) -> tuple[Array, Array, float]:
    """Iteratively reweighted least squares with Cauchy's weights, from the median onward: solution, weights, cost."""
    scale = 1.4826 * float(np.median(np.abs(values - np.median(values)))) + 1e-9
    weight = 1 / sigma**2 / (1 + ((values - np.median(values)) / (3 * scale)) ** 2)
    solution = np.zeros(design.shape[1])
    for _ in range(8):
        weighted = design * weight[:, None]
        solution = np.linalg.solve(weighted.T @ design + 1e-12 * np.eye(design.shape[1]), weighted.T @ values)
        residual = (values - design @ solution) / sigma
        loose = max(1.4826 * float(np.median(np.abs(residual))), 1.0)
        weight = 1 / sigma**2 / (1 + (residual / (2.5 * loose)) ** 2)
    cost = float((np.minimum(np.abs(residual), 5) ** 2).sum())
    return solution, weight, cost
