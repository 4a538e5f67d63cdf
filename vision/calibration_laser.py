"""Calibration of the dot-grid laser: fan, rotation and position in the left camera's frame, from walls at several
distances.

Each wall is a plane; its dots are seen by both eyes, so that the plane is measured and each dot lies where the left
eye's ray meets it. A dot's points on all walls lie on one ray of the laser. One wall alone cannot tell position from
fan.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from vision.calibration_fit import CalibrationError
from vision.camera import LaserGrid, StereoPair
from vision.capture import rotation_of

Array = NDArray[np.float64]

FEWEST_DOTS = 12
LEAST_DEPTH_RATIO = 1.3


@dataclass(frozen=True)
class WallDots:
    """The dots on one wall that both eyes saw: row (n,) and column (n,) in the grid, left (n, 2) and right (n, 2) in
    pixels."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    left: Array
    right: Array


@dataclass(frozen=True)
class LaserFit:
    """The laser with the sigma of each quantity: fan (2,) rad, angles (3,) roll, pitch, yaw rad, position (3,) m.
    rms_px: of the dots in the left image; wall_distance_m (walls,): of each plane along the optical axis."""

    laser: LaserGrid
    angles: Array
    fan_sigma: Array
    angle_sigma: Array
    position_sigma_m: Array
    rms_px: float
    wall_distance_m: Array
    warnings: tuple[str, ...]


def fit_laser(walls: Sequence[WallDots], stereo: StereoPair, nominal: LaserGrid) -> LaserFit:
    """The laser that threw these dots. `nominal`: rows, columns and a first guess.

    Raises:
        CalibrationError: too few walls or dots, or walls that are no planes.
    """
    if len(walls) < 2:
        raise CalibrationError(
            "one wall cannot tell the laser's position from its fan: give two or more at other distances"
        )
    points, distances = [], []
    for number, wall in enumerate(walls):
        if len(wall.row) < FEWEST_DOTS:
            raise CalibrationError(f"wall {number + 1} shows {len(wall.row)} dots, at least {FEWEST_DOTS} are needed")
        on_wall, distance = on_plane(wall, stereo, number)
        points.append(on_wall)
        distances.append(distance)
    row, column = (np.concatenate([getattr(wall, name) for wall in walls]) for name in ("row", "column"))
    where, seen = np.concatenate(points), np.concatenate([wall.left for wall in walls])
    across = 2 * column / (nominal.columns - 1) - 1
    down = 2 * row / (nominal.rows - 1) - 1

    def residuals(x: Array) -> Array:
        rays = np.column_stack([np.ones(len(row)), np.tan(x[0] / 2) * across, np.tan(x[1] / 2) * down])
        rays = rays @ rotation_of(*x[2:5]).T
        along = ((where - x[5:]) * rays).sum(axis=1) / (rays**2).sum(axis=1)
        off: Array = (stereo.left.project(x[5:] + along[:, None] * rays) - seen).ravel()
        return off

    pitch = -np.arcsin(np.clip(nominal.rotation[2, 0], -1, 1))
    yaw = np.arctan2(nominal.rotation[1, 0], nominal.rotation[0, 0])
    roll = np.arctan2(nominal.rotation[2, 1], nominal.rotation[2, 2])
    start = np.array([*nominal.fan, roll, pitch, yaw, *nominal.position])
    robust = least_squares(residuals, start, loss="soft_l1", x_scale=[0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
    solution = least_squares(residuals, robust.x, loss="soft_l1", f_scale=3.0, x_scale="jac")
    x, jacobian = solution.x, np.asarray(solution.jac, float)
    off = residuals(x)
    rms = float(np.sqrt(np.mean(off**2)))
    sigma = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian))) * rms * np.sqrt(len(off) / (len(off) - 8))
    warnings = []
    ratio = max(distances) / min(distances)
    if ratio < LEAST_DEPTH_RATIO:
        warnings.append(f"the walls stand at nearly one distance (ratio {ratio:.2f}): take them at 2 and at 5 m, say")
    if sigma[5:].max() > 0.01:
        warnings.append(f"the laser's position is known to ±{sigma[5:].max() * 1000:.0f} mm only")
    if rms > 1.5:
        warnings.append(
            f"the dots miss their rays by {rms:.1f} px: a wall may not be flat, or rows and columns are mixed up"
        )
    laser = LaserGrid(
        nominal.rows, nominal.columns, (float(x[0]), float(x[1])), x[5:].copy(), np.asarray(rotation_of(*x[2:5]), float)
    )
    return LaserFit(laser, x[2:5], sigma[:2], sigma[2:5], sigma[5:], rms, np.array(distances), tuple(warnings))


def on_plane(wall: WallDots, stereo: StereoPair, number: int = 0) -> tuple[Array, float]:
    """Dots (n, 3) m in the left camera's frame on the plane that fits their stereo points, and its distance along the
    axis.

    Raises: CalibrationError: the points do not lie in a plane.
    """
    left = stereo.left.rays(wall.left)
    points = triangulated(left, stereo.right.rays(wall.right), stereo)
    # Inverse depth is linear in the image position for a plane, and its error is the same everywhere.
    design, inverse = left, 1 / points[:, 0]
    weight: Array = np.ones(len(left))
    plane: Array = np.zeros(3)
    for _ in range(10):
        plane = np.asarray(np.linalg.lstsq(design * weight[:, None], inverse * weight, rcond=None)[0], float)
        off = inverse - design @ plane
        spread = 1.4826 * float(np.median(np.abs(off))) + 1e-9
        weight = np.asarray(1 / np.sqrt(1 + (off / (2.5 * spread)) ** 2), float)
    if not (np.isfinite(plane).all() and (design @ plane > 0).all()):
        raise CalibrationError(f"the dots on wall {number + 1} do not lie in a plane before the cameras")
    return left / (design @ plane)[:, None], float(1 / plane[0])


def triangulated(left: Array, right: Array, stereo: StereoPair) -> Array:
    """Points (n, 3) m in the left camera's frame midway between pairs of rays (n, 3) of both eyes, where they pass each
    other nearest (the thesis's triangulation, without its assumption of parallel cameras)."""
    turned = right @ stereo.rotation  # right rays in the left camera's axes
    lens = -stereo.rotation.T @ stereo.translation
    a, b, c = (left * left).sum(1), (left * turned).sum(1), (turned * turned).sum(1)
    d, e = left @ lens, turned @ lens
    along_left, along_right = (c * d - b * e) / (a * c - b * b), (b * d - a * e) / (a * c - b * b)
    return np.asarray((left * along_left[:, None] + lens + turned * along_right[:, None]) / 2, float)
