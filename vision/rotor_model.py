"""What a rotor's straight blade edges look like from anywhere before it: three equal tapered blades on a cone, in
perspective.

Parameters (8,): hub y, z in the image frame (px); turn of the rotor (rad, clockwise from +y_im, of one blade); yaw and
tilt of the rotor's axis against the camera's (rad); then, at the hub's distance and in px, how far before and behind a
blade's axis its edges would start at the hub, and the inverse of the distance at which they would meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera

Array = NDArray[np.float64]

CONE = np.deg2rad(2.5)
INBOARD = 2.1  # the edges are straight from this many root widths (of the straight edges, prolonged) outward
OUTBOARD = 0.85  # of the length at which they would meet
# What is known of any rotor from any place before it: mean and sigma.
YAW = 0.0, np.deg2rad(12.0)
TILT = np.deg2rad(5.0), np.deg2rad(5.0)
LEADING_SHARE = 0.31, 0.04  # of a blade's width before its axis
SLENDER = 9.5, 0.2  # length over width of the prolonged edges; sigma of its logarithm


@dataclass(frozen=True)
class Outline:
    """Points (k, 3, 2, n, 2) in the undistorted image frame: k rotors, blades, leading and trailing edge, along the
    edge."""

    points: Array
    direction: Array  # (k, 3, 2, 2) unit vectors along the edges


def outline(parameters: Array, shares: Array, camera: Camera) -> Outline:
    """The edges of rotors (k, 8) at shares (n,) of their straight stretch."""
    hub, unit = place(parameters, camera)
    axes = rotor_axes(parameters)
    leading, trailing, taper = parameters[:, 5], parameters[:, 6], np.maximum(parameters[:, 7], 1e-4)
    first = INBOARD * (leading + trailing)
    last = np.maximum(OUTBOARD / taper, first + 10)
    r = first[:, None] + (last - first)[:, None] * shares
    points = np.empty((len(parameters), 3, 2, len(shares), 2))
    for b in range(3):
        along, across = blade_axes(parameters[:, 2] + b * 2 * np.pi / 3, axes)
        for s, root in enumerate((leading, -trailing)):
            w = root[:, None] * (1 - taper[:, None] * r)
            x, y, z = (hub[:, k, None] + (r * along[:, k, None] + w * across[:, k, None]) / unit for k in range(3))
            points[:, b, s, :, 0] = camera.fx * y / x
            points[:, b, s, :, 1] = camera.fy * z / x
    points += np.array([camera.cx, camera.cy]) - camera.centre
    step = points[..., -1, :] - points[..., 0, :]
    return Outline(points, step / np.linalg.norm(step, axis=-1, keepdims=True))


def place(parameters: Array, camera: Camera) -> tuple[Array, float]:
    """The hub (k, 3) in the camera frame at unit depth, and px per unit there."""
    yz = (parameters[:, :2] + camera.centre - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    return np.column_stack([np.ones(len(parameters)), yz]), camera.fx


def rotor_axes(parameters: Array) -> Array:
    """(k, 3, 3): columns are the rotor's axes in the camera frame."""
    cy, sy = np.cos(parameters[:, 3]), np.sin(parameters[:, 3])
    cp, sp = np.cos(parameters[:, 4]), -np.sin(parameters[:, 4])
    zero = np.zeros_like(cy)
    rows = [[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, zero, cp]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def blade_axes(turn: Array, axes: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 3) in the camera frame along and clockwise across blades at turns (k,), cone included."""
    x, y, z = axes[..., 0], axes[..., 1], axes[..., 2]
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
    return np.cos(CONE) * (cos * y + sin * z) - np.sin(CONE) * x, cos * z - sin * y


def directions(parameters: Array, camera: Camera) -> Array:
    """Directions (3,) of the blades' axes in the undistorted image, of one rotor (8,)."""
    hub, _ = place(parameters[None], camera)
    axes = rotor_axes(parameters[None])
    found = []
    for b in range(3):
        along = blade_axes(parameters[None, 2] + b * 2 * np.pi / 3, axes)[0][0]
        y, z = (along[1:] - hub[0, 1:] * along[0]) * (camera.fx, camera.fy)
        found.append(np.arctan2(z, y) % (2 * np.pi))
    return np.array(found)


def surprise(parameters: Array) -> Array:
    """(k, 4): by how many sigmas rotors (k, 8) differ from what is known of any rotor."""
    width = np.maximum(parameters[:, 5] + parameters[:, 6], 1e-3)
    slender = np.log(np.maximum(1 / (np.maximum(parameters[:, 7], 1e-5) * width), 1e-3) / SLENDER[0]) / SLENDER[1]
    return np.column_stack(
        [
            (parameters[:, 3] - YAW[0]) / YAW[1],
            (parameters[:, 4] - TILT[0]) / TILT[1],
            (parameters[:, 5] / width - LEADING_SHARE[0]) / LEADING_SHARE[1],
            slender,
        ]
    )
