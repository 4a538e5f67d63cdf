"""The edges of the inspected blade as a camera truly sees them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from devices.world.turbine import TurbineShape
from vision.camera import Camera
from vision.capture import CameraPose

Array = NDArray[np.float64]


def outlines(shape: TurbineShape, stations: Array) -> Array:
    """Outlines (n, m, 3) of the inspected blade's sections at stations (n,), in local NED."""
    sections = shape.blade.sections(stations)
    outline: Array = shape.blade_frame().to_ned(sections.reshape(-1, 3)).reshape(sections.shape)
    return outline


def edges(shape: TurbineShape, outline: Array, camera: Camera, pose: CameraPose, side: str) -> tuple[Array, Array]:
    """Of each section's outline (n, m, 3) the point that lies farthest to the leading or trailing side in the image.

    Returns its pixels (n, 2), NaN where any of the section is behind the lens, and the points (n, 3) in local NED. On
    the thick root this is not the point farthest to the side in space: a camera close by sees less than half of it.
    """
    frame = shape.blade_frame()
    pixels = camera.project(pose.from_ned(outline.reshape(-1, 3))).reshape(*outline.shape[:2], 2)
    span, across = frame.span @ pose.rotation, frame.across @ pose.rotation
    sideways = np.array([-span[2], span[1]])
    sideways *= np.sign(sideways @ across[1:]) * (1.0 if side == "leading" else -1.0)
    reach = pixels @ sideways
    behind = np.isnan(reach).any(axis=1)
    rows = np.arange(len(outline))
    edge = np.where(np.isnan(reach), -np.inf, reach).argmax(axis=1)
    at: Array = pixels[rows, edge]
    at[behind] = np.nan
    return at, outline[rows, edge]
