"""What a rig delivers at one instant: four images, when they were taken, and from where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class CameraPose:
    """Where the left camera is: position (3,) in metres and rotation (3, 3), camera axes to local NED.

    A point p of the camera frame is `rotation @ p + position` in local NED. `sigma_m` is the standard deviation of the
    position *relative to where it was seconds ago*, which is what a tracker cares about.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    sigma_m: float = 0.02

    def to_ned(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) or (3,) of the camera frame in local NED."""
        result: NDArray[np.float64] = points @ self.rotation.T + self.position
        return result

    def from_ned(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (n, 3) or (3,) of local NED in the camera frame."""
        result: NDArray[np.float64] = (points - self.position) @ self.rotation
        return result


@dataclass(frozen=True)
class StereoFrames:
    """Left and right images, laser off and laser on: each (h, w) grey or (h, w, 3) BGR, uint8, or None where missing.

    `stamp_s` is the exposure on the executive's clock. `pose` is where the vehicle's *telemetry* says the left
    camera was; the rig leaves it None, since a camera does not know.
    """

    stamp_s: float
    left: Image | None = None
    right: Image | None = None
    left_laser: Image | None = None
    right_laser: Image | None = None
    pose: CameraPose | None = None


def rotation_of(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """Rotation (3, 3) of body (or camera) axes into local NED for angles in radians: R_z(yaw) R_y(pitch) R_x(roll)."""
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def camera_pose(
    position: NDArray[np.float64],
    attitude: NDArray[np.float64],
    gimbal: NDArray[np.float64],
    mount: NDArray[np.float64],
    sigma_m: float = 0.02,
) -> CameraPose:
    """Pose of the left camera on a stabilised gimbal.

    position (3,) m in local NED, attitude (3,) roll, pitch, yaw rad, gimbal (2,) yaw from north and pitch up from the
    horizon in rad (its roll is held at zero), mount (3,) m: the left lens in body axes.
    """
    return CameraPose(position + rotation_of(*attitude) @ mount, rotation_of(0.0, gimbal[1], gimbal[0]), sigma_m)
