"""Whether the images can have been taken with the rig that its file describes: two eyes and the laser know each
distance twice over, and a wrong rig makes them contradict each other."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.camera import LaserGrid
from vision.grid import Matches, grid_coordinates
from vision.surface_kernels import median

Array = NDArray[Any]  # of floats

APART = 0.08  # relative, between the distance of the two eyes and that of one eye and the laser: one of them is wrong
SURE = 4.0  # standard deviations
STEP = 0.01  # relative change of inverse depth, over which the laser's view of a point is differentiated
OFF_GRID = 0.04  # of the grid's spacing, by which most dots miss a whole row and column: by chance they miss it by 0.09


def rig_doubt(rays: Array, matches: Matches, laser: LaserGrid) -> str | None:
    """Why the rig cannot be the one that matches (n,) of two eyes along rays (n, 3), x = 1, of the left one say it is;
    None if it can."""
    misfit = median(matches.misfit)
    if misfit > OFF_GRID:
        return f"the dots miss the laser's grid by {misfit:.2f} of its spacing: is it the right rig file?"
    apart, sigma = laser_disagrees(rays, matches, laser)
    if abs(apart) > max(APART, SURE * sigma):
        return f"eyes and laser disagree by {abs(apart):.0%} on the distance: is it the right rig file?"
    return None


def laser_disagrees(rays: Array, matches: Matches, laser: LaserGrid) -> tuple[float, float]:
    """By what share the inverse depths of matches (n,) along rays (n, 3) would have to grow for the laser to see them
    at whole rows and columns, least squares over all of them, and its sigma, large where the laser is in the lens."""
    place = np.column_stack([matches.row, matches.column])
    seen = grid_coordinates(rays / matches.inverse_depth[:, None], laser)
    lever = (grid_coordinates(rays / ((1 + STEP) * matches.inverse_depth)[:, None], laser) - seen) / STEP
    information = float((lever * lever).sum()) + 1e-9
    apart = float((lever * (place - seen)).sum()) / information
    rest = place - seen - apart * lever
    return apart, float(np.sqrt((rest * rest).mean() / information))
