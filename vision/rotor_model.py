"""What a rotor's blade edges look like from anywhere before it: three equal blades on a cone, turned about their own
axes by one pitch, in perspective.

A blade's section is a round nose, as thick as the blade, and a sharp trailing edge, so that the outline is right from
the front and from aside, of blades in the rotor's plane and of feathered ones, of which only the thickness is seen.

Parameters (12,): hub y, z in the image frame (px); turn of the rotor (rad, clockwise from +y_im, of one blade); yaw and
tilt of the rotor's axis against the camera's (rad); pitch of the blades (rad); logarithm of the rotor's radius at the
hub's distance in px; logarithms of what the largest chord, the root's and the tip's differ by from a usual blade's; by
how many chords the axis lies further back; logarithm of how much thicker it is.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera
from vision.rotor_kernels import traces

Array = NDArray[np.float64]

HUB, TURN, YAW, TILT, PITCH, RADIUS, CHORD, ROOT, TIP, AXIS, THICKNESS = slice(0, 2), 2, 3, 4, 5, 6, 7, 8, 9, 10, 11
SIZE = 12
CONE = np.deg2rad(2.5)
SHAPE = np.array([0.047, 0.088, 0.013])  # root's diameter, largest chord and tip's chord of a usual blade, in radii
INBOARD, OUTBOARD = 0.055, 0.94  # stations between which the outline is known; the spinner hides the rest
# What is known of any rotor from any place before it: mean and sigma.
USUAL_TILT = np.deg2rad(5.0)
KNOWN = {
    YAW: (0.0, np.deg2rad(14.0)),
    TILT: (USUAL_TILT, np.deg2rad(5.0)),
    CHORD: (0.0, 0.3),
    ROOT: (0.0, 0.3),
    TIP: (0.0, 0.4),
    AXIS: (0.0, 0.03),
    THICKNESS: (0.0, 0.12),
}
USUAL_SIZE = 0.8, 0.45  # a rotor's radius over its distance; sigma of its logarithm
PITCHES = np.deg2rad(-4.0), np.deg2rad(94.0)
PITCH_SIGMA = np.deg2rad(4.0)  # beyond these
# Along a usual blade, by share of the radius.
_STATION = (0.025, 0.055, 0.12, 0.22, 0.36, 0.51, 0.66, 0.80, 0.92, 1.0)
_RISE = (0.0, 0.0, 0.55, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)  # of the way from the root to the largest chord
_FALL = (0.0, 0.0, 0.0, 0.0, 0.26, 0.47, 0.65, 0.82, 0.935, 1.0)  # of the way from there to the tip's
_THICK = (1.0, 1.0, 0.62, 0.36, 0.26, 0.21, 0.19, 0.175, 0.165, 0.16)
_AXIS = (0.5, 0.5, 0.40, 0.32, 0.31, 0.30, 0.30, 0.30, 0.30, 0.30)
_TWIST_DEG = (13.0, 13.0, 12.0, 11.0, 7.5, 4.5, 2.6, 1.2, 0.4, 0.0)


@cache
def table(samples: int) -> Array:
    """(n, 6): the usual blade at n stations, for `vision.rotor_kernels`."""
    station = np.linspace(INBOARD, OUTBOARD, samples)
    columns = [np.interp(station, _STATION, values) for values in (_RISE, _FALL, _THICK, _AXIS, _TWIST_DEG)]
    # The kernel goes from a round section to the foil with the rise.
    columns[2] = np.where(columns[0] > 0, 1 + (columns[2] - 1) / np.maximum(columns[0], 1e-9), 1.0)
    columns[4] = np.deg2rad(columns[4])
    return np.ascontiguousarray(np.column_stack([station, *columns]))


def lens(camera: Camera) -> Array:
    """(4,): focal lengths and the principal point in the image frame."""
    return np.array([camera.fx, camera.fy, *(np.array([camera.cx, camera.cy]) - camera.centre)])


def outline(parameters: Array, samples: int, camera: Camera) -> Array:
    """Points (k, 3, 2, n, 2) in the undistorted image frame of rotors (k, 12): blade, leading and trailing edge, n
    stations."""
    points: Array = traces(np.ascontiguousarray(parameters, float), table(samples), CONE, SHAPE, lens(camera))
    return points


def rotor_axes(parameters: Array) -> Array:
    """(3, 3): columns are the axes of a rotor (12,) in the camera frame."""
    cy, sy = np.cos(parameters[YAW]), np.sin(parameters[YAW])
    cp, sp = np.cos(parameters[TILT]), -np.sin(parameters[TILT])
    return np.array([[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, 0.0, cp]])


def directions(parameters: Array, camera: Camera) -> Array:
    """Directions (3,) of the blades' axes in the undistorted image, of one rotor (12,)."""
    hub = (parameters[HUB] - lens(camera)[2:]) / (camera.fx, camera.fy)
    x, y, z = rotor_axes(parameters).T
    turn = parameters[TURN] + np.arange(3)[:, None] * 2 * np.pi / 3
    along = np.cos(CONE) * (np.cos(turn) * y + np.sin(turn) * z) - np.sin(CONE) * x
    seen = (along[:, 1:] - hub * along[:, :1]) * (camera.fx, camera.fy)
    result: Array = np.arctan2(seen[:, 1], seen[:, 0]) % (2 * np.pi)
    return result


def surprise(parameters: Array, camera: Camera) -> Array:
    """(k, 9): by how many sigmas rotors (k, 12) differ from what is known of any rotor."""
    known = np.column_stack([(parameters[:, at] - mean) / sigma for at, (mean, sigma) in KNOWN.items()])
    pitch = parameters[:, PITCH]
    beyond = (np.minimum(pitch - PITCHES[0], 0) + np.maximum(pitch - PITCHES[1], 0)) / PITCH_SIGMA
    size = (parameters[:, RADIUS] - np.log(USUAL_SIZE[0] * camera.fx)) / USUAL_SIZE[1]
    return np.column_stack([known, beyond, size])
