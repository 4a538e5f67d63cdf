"""Pointing the camera (5.10 to 5.13). Gimbal angles are yaw clockwise from north and pitch up from the horizon,
radians."""

from __future__ import annotations

from math import asin, atan, atan2

import numpy as np
from numpy.typing import NDArray

from flight.guidance.angles import difference, wrap
from vision.capture import rotation_of

Array = NDArray[np.float64]


def camera_to_body(point: Array, yaw: float, pitch: float) -> Array:
    """(5.10, 5.11): P^b = R_z(ψ_c) R_y(θ_c) p^c for points (3,) or (n, 3), gimbal yaw and pitch relative to the
    body."""
    result: Array = np.asarray(point, float) @ rotation_of(0.0, pitch, yaw).T
    return result


def body_to_ned(point: Array, attitude: Array) -> Array:
    """Vectors (3,) or (n, 3) of body axes in NED axes; attitude (3,) = roll, pitch, yaw."""
    result: Array = np.asarray(point, float) @ rotation_of(*attitude).T
    return result


def angles_of(direction: Array) -> tuple[float, float]:
    """Gimbal yaw and pitch that lay the optical axis along a direction (3,) of NED, of any length but zero."""
    x, y, z = (float(v) for v in np.asarray(direction, float) / np.linalg.norm(direction))
    return atan2(y, x), asin(max(-1.0, min(1.0, -z)))


def axis_of(yaw: float, pitch: float) -> Array:
    """The optical axis (3,) in NED for gimbal angles: the inverse of `angles_of`."""
    axis: Array = rotation_of(0.0, pitch, yaw)[:, 0]
    return axis


def turn_toward(point_px: Array, focal_px: float) -> tuple[float, float]:
    """(5.12): by how much to turn yaw (right) and pitch (up) to bring an image point (2,) to the centre.

    The thesis's tan ψ = p_y / f and tan θ = p_z / f, each about the camera's own axis; z points down, pitch up.
    """
    return atan(point_px[0] / focal_px), -atan(point_px[1] / focal_px)


def pd_angles(
    reference: tuple[float, float],
    measured: tuple[float, float],
    last_error: tuple[float, float] | None,
    elapsed_s: float,
    p: float = 1.0,
    d: float = 0.0,
) -> tuple[tuple[float, float], tuple[float, float]]:
    """(5.13): the angles to command, and the error (yaw, pitch) to pass as `last_error` next time.

    command = measured + P error + D (change of the error a second); P = 1 commands the reference itself, more drives a
    lagging gimbal harder.
    """
    error = difference(reference[0], measured[0]), reference[1] - measured[1]
    rate = (0.0, 0.0)
    if last_error is not None and elapsed_s > 0:
        rate = (error[0] - last_error[0]) / elapsed_s, (error[1] - last_error[1]) / elapsed_s
    yaw = wrap(measured[0] + p * error[0] + d * rate[0])
    return (yaw, measured[1] + p * error[1] + d * rate[1]), error
