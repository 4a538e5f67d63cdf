"""Gives every spot its row and column in the laser's grid: left eye, right eye and laser ray must meet in one point.

A pair of spots on one epipolar line gives a point; the laser sees that point at some (row, column), which must be a
whole number. Pairs whose neighbours in the grid lie at a like depth form a surface. A wrong shift of the grid makes
whole surfaces too, but seldom a whole number on both axes; where two contradicting surfaces stand up alike, the scene
is refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from vision.camera import Camera, LaserGrid, StereoPair
from vision.capture import Image

Array = NDArray[Any]  # of floats
Indices = NDArray[np.int64]

NEAREST_M, FARTHEST_M = 0.8, 25.0
EPIPOLAR_PX = 1.6  # of the working image
OFF_GRID = 0.13  # of the grid's spacing: how far from a whole row and column a dot may seem to the laser
GRID_SIGMA = 0.035
NEIGHBOURS = 2  # rows and columns over which a surface holds together
LEAST_SURFACE = 4


@dataclass(frozen=True)
class Matches:
    """Pairs of spots: indices into left and right spots (right is -1 with one eye), row, column, inverse depth (1/m),
    its sigma, misfit against the grid, and `surface`, 0 for the surface with most dots, counted on by size."""

    left: Indices
    right: Indices
    row: Indices
    column: Indices
    inverse_depth: Array
    sigma: Array
    misfit: Array
    surface: Indices

    def __len__(self) -> int:
        return len(self.left)

    def take(self, which: NDArray[np.bool_] | Indices) -> Matches:
        """Some of them."""
        return Matches(
            self.left[which],
            self.right[which],
            self.row[which],
            self.column[which],
            self.inverse_depth[which],
            self.sigma[which],
            self.misfit[which],
            self.surface[which],
        )


def inverse_depths(rays: Array, other_rays: Array, other_eye: Array) -> tuple[Array, Array, Array]:
    """Where rays (n, 3) of the left lens, x = 1, meet rays (m, 3) from `other_eye` (3,), both in the left camera's
    axes.

    Returns (w, miss, lever), each (n, m): inverse depth in 1/m, distance of the two rays in the left image at focal
    length one, and the change of image position by 1/m of inverse depth, in the same unit. Linear in w: no
    singularity at infinity.
    """
    other = other_rays[:, 1:] / other_rays[:, :1]
    lever = other_eye[1:] - other * other_eye[0]
    size = np.maximum(np.hypot(lever[:, 0], lever[:, 1]), 1e-9)
    apart = rays[:, None, 1:] - other[None]
    along = (apart * (lever / size[:, None])).sum(axis=2)
    miss = (apart[..., 0] * lever[:, 1] - apart[..., 1] * lever[:, 0]) / size
    return along / size, miss, np.broadcast_to(size, along.shape)


def grid_coordinates(points: Array, laser: LaserGrid) -> Array:
    """(row, column) (n, 2), not whole numbers, at which the laser sees points (n, 3) of the left camera's frame."""
    seen = (points - laser.position) @ laser.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        across = seen[:, 1] / seen[:, 0] / np.tan(laser.fan[0] / 2)
        down = seen[:, 2] / seen[:, 0] / np.tan(laser.fan[1] / 2)
    result: Array = np.column_stack([(down + 1) / 2 * (laser.rows - 1), (across + 1) / 2 * (laser.columns - 1)])
    return result


def expected_points(laser: LaserGrid, depth_m: float, slope: Array) -> Array:
    """Points (rows * columns, 3) m where the laser's rays meet the plane depth = depth_m + slope · (y, z); NaN
    behind."""
    directions = laser.directions().reshape(-1, 3)
    ahead = directions[:, 0] - directions[:, 1:] @ slope
    reach = (depth_m + laser.position[1:] @ slope - laser.position[0]) / ahead
    points = laser.position + reach[:, None] * directions
    points[(reach <= 0) | (points[:, 0] < 0.3)] = np.nan
    return np.asarray(points, float)


def reachable(laser: LaserGrid, camera: Camera, rotation: Array, translation: Array, margin_px: int = 5) -> Image:
    """Mask (h, w), 255 where a dot between NEAREST_M and FARTHEST_M can be in a camera's image.

    rotation (3, 3) and translation (3,) m bring points of the left camera's frame into this camera's.
    """
    mask = np.zeros((camera.height, camera.width), np.uint8)
    distances = 1 / np.linspace(1 / FARTHEST_M, 1 / NEAREST_M, 24)
    for direction in laser.directions().reshape(-1, 3):
        points = laser.position + distances[:, None] * direction
        pixels = camera.project(points @ rotation.T + translation)
        pixels = pixels[np.isfinite(pixels[:, 0])].clip(-1e4, 1e4)
        trace = np.rint(pixels * 8).astype(np.int32)
        cv2.polylines(mask, [trace.reshape(-1, 1, 2)], False, 255, 2 * margin_px + 1, cv2.LINE_8, 3)
    return mask


def match_eyes(
    rays_left: Array,
    rays_right: Array,
    stereo: StereoPair,
    laser: LaserGrid,
    sigma_left: Array,
    sigma_right: Array,
) -> tuple[Matches, bool]:
    """Matches of two eyes and whether they are ambiguous. Rays (n, 3) with x = 1, each in its own camera's axes;
    sigmas (n,) are of their positions at focal length one."""
    eye = -stereo.rotation.T @ stereo.translation
    w, miss, lever = inverse_depths(rays_left, rays_right @ stereo.rotation, eye)
    near = np.abs(miss) < EPIPOLAR_PX / stereo.left.fx
    left, right = np.nonzero(near & (w > 1 / FARTHEST_M) & (w < 1 / NEAREST_M))
    depth = w[left, right]
    points = rays_left[left] / depth[:, None]
    place = grid_coordinates(points, laser)
    sigma = np.hypot(sigma_left[left], sigma_right[right]) / lever[left, right]
    return _consistent(left, right, depth, sigma, place, laser)


def match_laser(rays: Array, laser: LaserGrid, focal_px: float, sigma: Array) -> tuple[Matches, bool]:
    """Matches of one eye with the laser as projector (2.74): right is -1. As `match_eyes` otherwise."""
    directions = laser.directions().reshape(-1, 3)
    w, miss, lever = inverse_depths(rays, directions, laser.position)
    near = np.abs(miss) < 2.0 / focal_px
    left, ray = np.nonzero(near & (w > 1 / FARTHEST_M) & (w < 1 / NEAREST_M))
    place = np.column_stack(np.divmod(ray, laser.columns)).astype(float)
    depth = w[left, ray]
    place[:, 0] += miss[left, ray] * focal_px / 30  # the misfit in units of the spacing, roughly
    spread = np.hypot(sigma[left], 0.3 / focal_px) / lever[left, ray]
    return _consistent(left, np.full(len(left), -1), depth, spread, place, laser)


def _consistent(
    left: Indices, right: Indices, depth: Array, sigma: Array, place: Array, laser: LaserGrid
) -> tuple[Matches, bool]:
    whole = np.rint(place)
    misfit = np.hypot(*(place - whole).T) if len(place) else np.empty(0)
    size = (laser.rows, laser.columns)
    keep = (misfit < OFF_GRID) & (whole >= 0).all(axis=1) & (whole < size).all(axis=1)
    row, column = whole[keep].astype(np.int64).T
    candidates = Matches(
        left[keep], right[keep], row, column, depth[keep], sigma[keep], misfit[keep], np.zeros(keep.sum(), np.int64)
    )
    return _surfaces(candidates)


def _surfaces(candidates: Matches) -> tuple[Matches, bool]:
    """The candidates that can be true together, in surfaces, largest first, and whether another reading is as good."""
    label = _components(candidates)
    weight = np.exp(-0.5 * (candidates.misfit / GRID_SIGMA) ** 2) + 0.05
    accepted: list[Matches] = []
    best_rival = 0.0
    alive = np.ones(len(candidates), bool)
    number = 0
    first_score = 0.0
    while alive.any():
        scores = np.bincount(label[alive], weight[alive])
        best = int(np.argmax(scores))
        members = np.flatnonzero(alive & (label == best))
        alive[members] = False
        members = _one_each(candidates, members)
        if len(members) < LEAST_SURFACE:
            break
        clash = np.flatnonzero(
            alive
            & (
                np.isin(candidates.left, candidates.left[members])
                | (np.isin(candidates.right, candidates.right[members]) & (candidates.right >= 0))
            )
        )
        if number == 0:
            first_score = float(weight[members].sum())
            if len(clash):
                best_rival = float(np.bincount(label[clash], weight[clash]).max())
        same_ray = np.isin(
            candidates.row * 1000 + candidates.column, candidates.row[members] * 1000 + candidates.column[members]
        )
        alive[clash] = False
        alive &= ~same_ray
        surface = candidates.take(members)
        accepted.append(
            Matches(
                surface.left,
                surface.right,
                surface.row,
                surface.column,
                surface.inverse_depth,
                surface.sigma,
                surface.misfit,
                np.full(len(members), number, np.int64),
            )
        )
        number += 1
    if not accepted:
        return candidates.take(np.zeros(len(candidates), bool)), False
    joined = Matches(
        *(np.concatenate(parts) for parts in zip(*(vars(part).values() for part in accepted), strict=True))
    )
    return joined, best_rival > 0.6 * first_score


def _components(candidates: Matches) -> Indices:
    """Labels (n,) of groups of candidates whose neighbours in the grid lie at a like depth."""
    row, column, w = candidates.row, candidates.column, candidates.inverse_depth
    dr, dc = np.abs(row[:, None] - row), np.abs(column[:, None] - column)
    steps = np.maximum(dr, dc)
    size = np.maximum(w[:, None], w)
    allowed = 0.055 * size * steps + 4 * np.hypot(candidates.sigma[:, None], candidates.sigma)
    joined = (steps > 0) & (steps <= NEIGHBOURS) & (np.abs(w[:, None] - w) < allowed)
    _, label = connected_components(csr_matrix(joined), directed=False)
    return np.asarray(label, np.int64)


def _one_each(candidates: Matches, members: Indices) -> Indices:
    """Members with no spot and no ray used twice: the one that fits the grid best stays."""
    order = members[np.argsort(candidates.misfit[members], kind="stable")]
    for key in (candidates.left, candidates.right, candidates.row * 1000 + candidates.column):
        values = key[order]
        if (values < 0).all():
            continue
        _, first = np.unique(values, return_index=True)
        order = order[np.sort(first)]
    return np.sort(order)
