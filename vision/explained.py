"""What a surface explains: spots that no pair of eyes has read, and dots that ought to be where there are none."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import LaserGrid, StereoPair
from vision.dots import Spots
from vision.grid import Matches, expected_points, grid_coordinates
from vision.observation import Dots
from vision.reduction import to_full
from vision.surface import Surface
from vision.surface_kernels import median

Array = NDArray[Any]  # of floats

LEAST_LEVEL = 0.4  # of the matched dots' level: a fainter spot that no other eye confirms is none
OFF_GRID = 0.08  # of the grid's spacing, for a spot that only one eye has read
LEAST_INVERSE = 0.03  # 1/m
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
    inside = np.ones(len(points), bool)
    pixels = []
    for camera, spots, known, there in (
        (stereo.left, left, matches.left, points),
        (stereo.right, right, matches.right, points @ stereo.rotation.T + stereo.translation),
    ):
        uv = camera.project(there)
        pixels.append(uv)
        if spots is None:
            continue
        size = (camera.width - 1 - BORDER_PX, camera.height - 1 - BORDER_PX)
        inside &= (uv > BORDER_PX).all(axis=1) & (uv < size).all(axis=1)
        unread = np.delete(spots.uv, known, axis=0)
        if len(unread):
            inside &= np.hypot(*(uv[:, None] - unread).transpose(2, 0, 1)).min(axis=1) > BORDER_PX
    outside = pixels[0][inside]
    outside = outside[~_enclosed(outside, left.uv[blade.left])]
    return np.asarray(outside - stereo.left.centre, float)


def _enclosed(points: Array, dots: Array) -> NDArray[np.bool_]:
    """Which of the points (m, 2) lie inside the convex hull of dots (n, 2)."""
    hull = cv2.convexHull(dots.astype(np.float32))[:, 0]
    sides = np.roll(hull, -1, axis=0) - hull
    turns = sides[:, 0] * (points[:, None, 1] - hull[:, 1]) - sides[:, 1] * (points[:, None, 0] - hull[:, 0])
    return np.asarray((turns > 0).all(axis=1) | (turns < 0).all(axis=1))
