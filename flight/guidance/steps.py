"""Steps in the camera frame (x forward, y right, z down) from what the image shows (5.4, 5.9, 5.23 to 5.25).

`depth` is fT/d, the distance along the optical axis in metres, so T/d is depth over the focal length: metres a pixel.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from flight.guidance.rooms import View

Array = NDArray[np.float64]


def step_to_edge(view: View, theta: float, rho: float, depth: float, standoff: float) -> Array:
    """(5.4, 5.9): the step (3,) m that brings the image centre onto the edge (theta, rho) at the wanted standoff
    D_d."""
    scale = depth / view.focal_px
    return np.array([depth - standoff, scale * rho * cos(theta), scale * rho * sin(theta)])


def step_along(omega: float, length: float, depth: float, standoff: float) -> Array:
    """(5.23): the step (3,) m of `length` D_m along the heading omega, at the wanted standoff."""
    return np.array([depth - standoff, length * cos(omega), length * sin(omega)])


def reposition_room(rho_free: float, rho_min: float) -> float:
    """ρ_d (5.24): pixels that the edge left behind may still move before it has only the least room left; never
    negative."""
    return max(rho_free - rho_min, 0.0)


def step_to_other_side(view: View, theta: float, room: float, depth: float, standoff: float) -> Array:
    """(5.25): the step (3,) m toward the other side, direction theta in the image, by the room ρ_d of the edge left
    behind."""
    return step_to_edge(view, theta, room, depth, standoff)


def fixation_point(theta: float, room: float) -> Array:
    """(5.26): the image point (2,) in pixels to turn the camera back to after the step: ρ_d toward the edge left
    behind."""
    return np.array([room * cos(theta), room * sin(theta)])
