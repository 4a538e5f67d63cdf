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

from vision.camera import Camera, LaserGrid, StereoPair
from vision.capture import Image
from vision.grid_kernels import components, medians, pairs, surfaces

Array = NDArray[Any]  # of floats
Indices = NDArray[np.int64]

NEAREST_M, FARTHEST_M = 0.8, 25.0
EPIPOLAR_PX = 1.6  # of the working image
OFF_GRID = 0.13  # of the grid's spacing: how far from a whole row and column a dot may seem to the laser
GRID_SIGMA = 0.035
LEAST_MISFIT = 0.01  # of the grid's spacing, by which the best calibrated dot is off
NEIGHBOURS = 2  # rows and columns over which a surface holds together
RELIEF = 0.055  # relative change of inverse depth from one dot to the next on one surface
LEAST_SURFACE = 4
SURFACE_SHARE = 0.25  # of the largest surface's dots: a nearer surface with as many is the blade,
SURE_SURFACE = 8  # or one of so many dots, which are never whole rows and columns of the laser by chance
AMBIGUOUS = 0.6  # support of another reading, over that of the best, from which neither is believed
MOST_PAIRS = 64  # that one spot may be part of


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
    room = MOST_PAIRS * max(len(rays_left), 1)
    index, value = np.empty((room, 4), np.int64), np.empty((room, 3))
    count = pairs(
        np.ascontiguousarray(rays_left), np.ascontiguousarray(rays_right @ stereo.rotation), eye,
        EPIPOLAR_PX / stereo.left.fx, 1 / FARTHEST_M, 1 / NEAREST_M, np.ascontiguousarray(sigma_left),
        np.ascontiguousarray(sigma_right), np.ascontiguousarray(laser.rotation.T), np.asarray(laser.position, float),
        np.tan(np.asarray(laser.fan) / 2), np.array([laser.rows, laser.columns]), OFF_GRID, index, value,
    )  # fmt: skip
    return _surfaces(index[: max(count, 0)], value[: max(count, 0)], laser)


def match_laser(rays: Array, laser: LaserGrid, focal_px: float, sigma: Array) -> tuple[Matches, bool]:
    """Matches of one eye with the laser as projector (2.74): right is -1. As `match_eyes` otherwise."""
    directions = laser.directions().reshape(-1, 3)
    w, miss, lever = inverse_depths(rays, directions, laser.position)
    near = np.abs(miss) < 2.0 / focal_px
    left, ray = np.nonzero(near & (w > 1 / FARTHEST_M) & (w < 1 / NEAREST_M))
    misfit = np.abs(miss[left, ray]) * focal_px / 30  # in units of the spacing, roughly
    spread = np.hypot(sigma[left], 0.3 / focal_px) / lever[left, ray]
    keep = misfit < OFF_GRID
    index = np.column_stack([left, np.full(len(left), -1), *np.divmod(ray, laser.columns)])[keep]
    return _surfaces(index, np.column_stack([w[left, ray], spread, misfit])[keep], laser)


def _surfaces(index: Indices, value: Array, laser: LaserGrid) -> tuple[Matches, bool]:
    """The candidates that can be true together, in surfaces, largest first, and whether another reading is as good."""
    index, (w, sigma, misfit) = np.ascontiguousarray(index), np.ascontiguousarray(value.T)
    label, surface = np.empty(len(index), np.int64), np.empty(len(index), np.int64)
    row, column = np.ascontiguousarray(index[:, 2]), np.ascontiguousarray(index[:, 3])
    number = components(row, column, w, sigma, laser.rows, laser.columns, NEIGHBOURS, RELIEF, label)
    weight = np.exp(-0.5 * (misfit / GRID_SIGMA) ** 2) + 0.05
    rival = surfaces(
        index,
        weight,
        misfit,
        np.argsort(misfit, kind="stable"),
        label,
        number,
        laser.rows * laser.columns,
        laser.columns,
        LEAST_SURFACE,
        LEAST_MISFIT,
        surface,
    )
    kept = np.flatnonzero(surface >= 0)
    kept = kept[np.argsort(surface[kept], kind="stable")]
    matches = Matches(
        index[kept, 0], index[kept, 1], row[kept], column[kept], w[kept], sigma[kept], misfit[kept], surface[kept]
    )
    return matches.take(_like_the_rest(matches)), bool(rival > AMBIGUOUS)


def _like_the_rest(matches: Matches) -> NDArray[np.bool_]:
    """Which matches lie as near to the grid as the others of their surface do: the calibration's error is theirs, too,
    and a spot that is no dot has no reason to share it."""
    if len(matches) == 0:
        return np.ones(0, bool)
    usual = medians(matches.misfit, matches.surface)
    return np.asarray(matches.misfit < 4 * usual[matches.surface] + GRID_SIGMA)


def nearest_surface(matches: Matches, least: int) -> Matches:
    """The matches of the nearest surface that has `least` dots and enough of all of them."""
    if len(matches) == 0:
        return matches
    count = np.bincount(matches.surface)
    depth = medians(matches.inverse_depth, matches.surface)
    enough = count >= max(least, min(SURFACE_SHARE * count.max(), SURE_SURFACE))
    if not enough.any():
        return matches.take(matches.surface == 0)
    return matches.take(matches.surface == int(np.argmax(np.where(enough, depth, 0))))
