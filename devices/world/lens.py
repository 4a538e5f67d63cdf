"""Lenses: the pinhole that kernels draw with, and the bending that distortion lays over its image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera, RigGeometry
from vision.capture import CameraPose

Array = NDArray[np.float64]


class Distortion:
    """A wider pinhole view and how to bend it into what the distorted lens sees."""

    def __init__(self, camera: Camera) -> None:
        v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
        rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
        self.u = (camera.fx * rays[:, 1] + camera.cx).reshape(u.shape)
        self.v = (camera.fy * rays[:, 2] + camera.cy).reshape(v.shape)
        left, top = max(int(np.ceil(-self.u.min())) + 2, 0), max(int(np.ceil(-self.v.min())) + 2, 0)
        self.u, self.v = (self.u + left).astype(np.float32), (self.v + top).astype(np.float32)
        self.pinhole = Camera(
            int(np.ceil(self.u.max())) + 3,
            int(np.ceil(self.v.max())) + 3,
            camera.fx,
            camera.fy,
            camera.cx + left,
            camera.cy + top,
        )

    def bend(self, image: NDArray, how: int = cv2.INTER_LINEAR) -> NDArray:  # type: ignore[type-arg]
        """The distorted image of a pinhole image."""
        kind = image.dtype
        flat = image.astype(np.float32) if kind == np.int32 else image  # triangles are few enough to be exact
        return np.asarray(cv2.remap(flat, self.u, self.v, how, borderMode=cv2.BORDER_CONSTANT), kind)


def lens_of(camera: Camera, factor: int = 1) -> Array:
    """fx, fy, cx, cy (4,) of a pinhole with `factor` samples a pixel each way."""
    centre = (np.array([camera.cx, camera.cy]) + 0.5) * factor - 0.5
    return np.array([camera.fx * factor, camera.fy * factor, *centre])


def right_pose(geometry: RigGeometry, pose: CameraPose) -> CameraPose:
    """Pose of the right camera where the left one's is `pose`."""
    stereo = geometry.stereo
    return CameraPose(
        pose.to_ned(-stereo.rotation.T @ stereo.translation), pose.rotation @ stereo.rotation.T, pose.sigma_m
    )
