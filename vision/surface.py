"""Fits the blade's surface: inverse depth is linear in the image for a plane, and bends gently for a blade."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.surface_kernels import agreement, local_planes, robust, solve

Array = NDArray[Any]  # of floats

LARGEST_BEND = 0.06  # relative change of inverse depth from the plane through a blade's dots
NOWHERE = 1e3  # 1/m, sigma of what does not count
SLOPE, BEND = 0.35, 3.0  # of a blade's surface: relative change of inverse depth per image unit at focal length one


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
        result: Array = _terms(rays, 6) @ self.coefficients
        return result


def _held(design: Array, inverse_depth: Array) -> Array:
    """The little information (k,) that a surface's slope is within SLOPE and its bend within BEND of none."""
    near = float(np.median(np.abs(inverse_depth)))
    spread = np.array([1e3, SLOPE, SLOPE, BEND, BEND, BEND])[: design.shape[1]] * near
    result: Array = 1 / spread**2
    return result


def _terms(rays: Array, count: int) -> Array:
    y, z = rays[:, 1], rays[:, 2]
    return np.ascontiguousarray(np.stack([np.ones_like(y), y, z, y * y, y * z, z * z][:count], axis=1))


def fit_surface(rays: Array, inverse_depth: Array, sigma: Array) -> Surface | None:
    """The surface through points at inverse depths (n,) along rays (n, 3), sigmas (n,) of the inverse depths.

    Robust against some wrong points. Where all lie on one line, the slope across it is what a blade's surface usually
    has (SLOPE), with that uncertainty. None with fewer than four points.
    """
    if len(rays) < 4:
        return None
    # A point may stand off its neighbours by a little relief of the surface, which no sensor noise explains.
    relief = np.hypot(sigma, 0.002 * inverse_depth)
    rays, inverse_depth = np.ascontiguousarray(rays), np.ascontiguousarray(inverse_depth)
    start = _consensus(rays, inverse_depth, relief)
    far = np.abs(inverse_depth - _terms(rays, 3) @ start) > 4 * relief + LARGEST_BEND * inverse_depth
    relief = np.where(far, NOWHERE, relief)  # what stands elsewhere pulls at nothing
    flat, flat_weight, flat_cost = _robust(_terms(rays, 3), inverse_depth, relief, start)
    coefficients, weight, count, bent = np.r_[flat, 0, 0, 0], flat_weight, 3, False
    unmodelled = 0.0
    if (~far).sum() >= 16:
        curved, curved_weight, curved_cost = _robust(_terms(rays, 6), inverse_depth, relief, np.r_[start, 0, 0, 0])
        free = int((~far).sum()) - 6
        reach = np.hypot(rays[:, 1], rays[:, 2]).min()
        better = (flat_cost - curved_cost) / 3 / max(curved_cost / free, 1.0)
        # A bend that is there and not modelled shows in the depth where the optical axis meets the surface.
        unmodelled = abs(flat[0] - curved[0]) * float(np.clip((better - 1) / 5, 0, 1))
        if better > 6 and reach < 0.08:
            unmodelled = 0.0
            coefficients, weight, count, bent = curved, curved_weight, 6, True
    design = _terms(rays, count)
    information = (design * weight[:, None]).T @ design + np.diag(_held(design, inverse_depth))
    covariance = np.linalg.inv(information)[:3, :3]
    residual = (inverse_depth - design @ coefficients[:count]) / relief
    inliers = (np.abs(residual) < 5) & ~far
    freedom = max(int(inliers.sum()) - count, 1)
    covariance *= max(1.0, float((residual[inliers] ** 2).sum()) / freedom)
    covariance[0, 0] += unmodelled**2
    a, b, c = coefficients[:3]
    if a <= 0:
        return None
    jacobian = np.array([[-1 / a**2, 0, 0], [b / a**2, -1 / a, 0], [c / a**2, 0, -1 / a]])
    return Surface(1 / a, np.array([-b / a, -c / a]), jacobian @ covariance @ jacobian.T, coefficients, inliers, bent)


def _consensus(rays: Array, inverse_depth: Array, sigma: Array) -> Array:
    """The plane (3,) through some dot and its neighbours on which most points lie; of two such planes that share few
    points, the nearer one if it has at least a third as many."""
    # A plane through a few neighbours is rough: what counts is to be on the same surface, not within the noise.
    terms, planes = _terms(rays, 3), np.empty((len(rays), 3))
    agrees = np.empty((len(rays), len(rays)), np.bool_)
    local_planes(terms, inverse_depth, sigma, planes)
    agreement(terms, inverse_depth, sigma, planes, agrees)
    count = agrees.sum(axis=1)
    # a plane that is steeper than blades are joins what stands one behind the other
    steep = np.hypot(planes[:, 1], planes[:, 2]) / np.maximum(planes[:, 0], 1e-6)
    count = count * np.exp(-0.5 * (steep / (2 * SLOPE)) ** 2)
    best = int(np.argmax(count))
    depth = (agrees * inverse_depth).sum(axis=1) / np.maximum(agrees.sum(axis=1), 1)
    apart_from_best = (agrees & agrees[best]).sum(axis=1) < 0.3 * agrees.sum(axis=1)
    rivals = np.flatnonzero(apart_from_best & (count >= max(6, count[best] / 3)) & (depth > 1.1 * depth[best]))
    chosen = int(rivals[np.argmax(count[rivals])]) if len(rivals) else best
    members = agrees[chosen]
    weighted = terms[members] / sigma[members, None] ** 2
    normal, right = weighted.T @ terms[members] + 1e-9 * np.eye(3), weighted.T @ inverse_depth[members]
    solve(normal, right)
    return np.asarray(right)


def _robust(design: Array, values: Array, sigma: Array, start: Array) -> tuple[Array, Array, float]:
    """Iteratively reweighted least squares from `start` onward: solution, weights, cost."""
    solution, weight = np.array(start, float), np.empty(len(values))
    cost = robust(design, values, sigma, _held(design, values), solution, weight)
    return solution, weight, cost
