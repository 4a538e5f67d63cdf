"""What a surface explains: spots that no pair of eyes has read, and dots that ought to be where there are none."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera, LaserGrid, StereoPair
from vision.compiled import compiled
from vision.dots import Spots
from vision.grid import Matches, expected_points, grid_coordinates
from vision.observation import Dots
from vision.reduction import to_full
from vision.surface import Surface
from vision.surface_kernels import median

Array = NDArray[Any]  # of floats
Flags = NDArray[np.bool_]

LEAST_LEVEL = 0.4  # of the matched dots' level: a fainter spot that no other eye confirms is none
OFF_GRID = 0.08  # of the grid's spacing, for a spot that only one eye has read
LEAST_INVERSE = 0.03  # 1/m
BEHIND_M = 1.0  # farther than the blade's surface goes on: no thick blade's rounded side
BORDER_PX = 6  # of the working image, within which a dot may be missed


def explained_dots(left: Spots, rays: Array, matches: Matches, surface: Surface, laser: LaserGrid, factor: int) -> Dots:
    """Every dot of the left image with its index: the matched ones, and those that the surface explains."""
    uv, row, column = left.uv[matches.left], matches.row, matches.column
    unread = np.ones(len(left), bool)
    unread[matches.left] = False
    rest = np.flatnonzero(unread)
    if len(matches):
        rest = rest[left.level[rest] > LEAST_LEVEL * median(left.level[matches.left].astype(float))]
    inverse = surface.inverse_depth(rays[rest])
    rest, inverse = rest[inverse > LEAST_INVERSE], inverse[inverse > LEAST_INVERSE]
    if len(rest):
        place = grid_coordinates(rays[rest] / inverse[:, None], laser)
        whole = np.rint(place)
        fits = (np.abs(place - whole).max(axis=1) < OFF_GRID) & (whole >= 0).all(axis=1)
        fits &= (whole < (laser.rows, laser.columns)).all(axis=1)
        taken = set(zip(row.tolist(), column.tolist(), strict=True))
        for index, (r, c) in zip(rest[fits], whole[fits].astype(int).tolist(), strict=True):
            if (r, c) not in taken:
                taken.add((r, c))
                uv, row, column = np.vstack([uv, left.uv[index]]), np.append(row, r), np.append(column, c)
    return Dots(to_full(uv, factor), row, column)


def absent_dots(
    left: Spots,
    right: Spots | None,
    matches: Matches,
    blade: Matches,
    surface: Surface,
    laser: LaserGrid,
    stereo: StereoPair,
) -> Array:
    """Where dots would lie in the left image (image frame, working px) if the blade went on, but are none; a spot that
    nothing explains there leaves it open, and so does a place between dots of the blade, which bulges inward nowhere:
    there one was overlooked."""
    points = expected_points(laser, surface.depth_m, surface.slope)
    free = np.isfinite(points[:, 0])
    seen = matches.take(matches.surface == blade.surface[0])  # also where it curves away from the fitted surface
    free[seen.row * laser.columns + seen.column] = False
    points = points[free]
    pixels = stereo.left.project(points)
    open_ = np.ones(len(points), np.bool_)
    _leave_room(pixels, _size(stereo.left), left.uv, matches.left, BORDER_PX, open_)
    if right is not None:
        there = stereo.right.project(points @ stereo.rotation.T + stereo.translation)
        _leave_room(there, _size(stereo.right), right.uv, matches.right, BORDER_PX, open_)
    hull = cv2.convexHull(left.uv[blade.left].astype(np.float32))[:, 0]
    _leave_outside(pixels, hull, open_)
    return np.asarray(pixels[open_] - stereo.left.centre, float)


def dots_behind(left: Spots, rays: Array, matches: Matches, blade: Matches, surface: Surface, centre: Array) -> Array:
    """Where the left image (image frame, working px) shows dots so far behind the blade that they lie on none of it."""
    other = matches.take(matches.surface != blade.surface[0])
    depth = 1 / np.maximum(surface.inverse_depth(rays[other.left]), LEAST_INVERSE)
    return np.asarray(left.uv[other.left[1 / other.inverse_depth > depth + BEHIND_M]] - centre, float)


def _size(camera: Camera) -> tuple[int, int]:
    return camera.width, camera.height


@compiled
def _leave_room(
    pixels: Array, size: tuple[int, int], spots: Array, known: NDArray[np.int64], room_px: float, open_: Flags
) -> None:
    """Of open_ (m,), let none stand whose pixel (m, 2) lies nearer than so many to the border of an image of this size
    or to one of the spots (n, 2) that are not among the known (k,)."""
    unread = np.ones(len(spots), np.bool_)
    for k in known:
        unread[k] = False
    width, height = size
    for m in range(len(pixels)):
        u, v = pixels[m, 0], pixels[m, 1]
        if not (room_px < u < width - 1 - room_px and room_px < v < height - 1 - room_px):
            open_[m] = False
            continue
        for n in range(len(spots)):
            if unread[n] and (u - spots[n, 0]) ** 2 + (v - spots[n, 1]) ** 2 <= room_px**2:
                open_[m] = False


@compiled
def _leave_outside(points: Array, hull: Array, open_: Flags) -> None:
    """Of open_ (m,), let none stand whose point (m, 2) lies inside a convex hull (k, 2)."""
    for m in range(len(points)):
        left, right = True, True
        for k in range(len(hull)):
            after = (k + 1) % len(hull)
            side_u, side_v = hull[after, 0] - hull[k, 0], hull[after, 1] - hull[k, 1]
            turn = side_u * (points[m, 1] - hull[k, 1]) - side_v * (points[m, 0] - hull[k, 0])
            left, right = left and turn > 0, right and turn < 0
        open_[m] = open_[m] and not (left or right)
