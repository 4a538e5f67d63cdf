"""A rig whose images are drawn from the vehicle's true pose in the simulated world."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from devices.rig import CaptureError
from devices.world.view import draw
from devices.world.world import Carrier, World
from vision.camera import RigGeometry
from vision.capture import CameraPose, StereoFrames, camera_pose

Array = NDArray[np.float64]


class SimulatedRig:
    """The simulated cameras and laser. Implements `devices.rig.Rig`.

    true_pose: where the vehicle truly is now. now: the executive's clock, which stamps the frames unless the pose
    brings its own stamp. mount (3,) m: the left lens in body axes. Two rigs with one seed, asked for the same poses in
    the same order, deliver the same bytes. rehearse: draw once now, not for the first time in flight."""

    simulated = True

    def __init__(
        self,
        world: World,
        geometry: RigGeometry,
        mount: Array,
        true_pose: Callable[[], Carrier],
        now: Callable[[], float],
        *,
        rehearse: bool = True,
    ) -> None:
        self.world = world
        self.geometry = geometry
        self.mount = np.asarray(mount, float)
        self._true_pose = true_pose
        self._now = now
        self._laser_armed = True
        self._count = 0
        self._lock = threading.Lock()
        if rehearse:
            self._rehearse()

    def capture(self, laser: bool = True) -> StereoFrames:
        """One set of frames; see `devices.rig.Rig.capture` and the fault switches of the world."""
        with self._lock:
            if laser and not self._laser_armed:
                raise CaptureError("the laser is not armed")
            faults, now = self.world.faults, self._now()
            self._count += 1
            if faults.active("images", now) or faults.active("blackout", now):
                raise CaptureError("no images: the simulated cameras deliver nothing (world.faults)")
            true = self._true_pose()
            stamp: float | None = getattr(true, "stamp_s", None)
            now = (now + self._now()) / 2  # asking for the pose may take a while
            pose = camera_pose(true.position, true.attitude, true.gimbal, self.mount)
            frames = draw(
                self.world.renderer,
                self.geometry,
                pose,
                laser=laser,
                lit=not faults.active("laser_off", now),
                stamp_s=now if stamp is None else stamp,
                frame=self._count,
                shift=self._shift(true, pose),
            )
            if faults.active("left_eye", now):
                frames = replace(frames, left=None, left_laser=None)
            if faults.active("right_eye", now):
                frames = replace(frames, right=None, right_laser=None)
            return frames

    def _rehearse(self) -> None:
        """Draw once and throw it away, so that nothing is compiled or built in flight."""
        frame = self.world.shape.blade_frame()
        position = frame.to_ned(np.array([self.world.shape.blade.tip_radius_m / 2, 0.0, -4.0]))
        draw(self.world.renderer, self.geometry, CameraPose(position, self.world.shape.rotation), shift=(1.5, 1.5))

    def _shift(self, true: Carrier, pose: CameraPose) -> tuple[float, float]:
        """Pixels that the scene in the middle of the image moves by between the laser-off and the laser-on exposure."""
        gap = self.world.settings.camera.frame_gap_s
        if true.velocity is None or gap == 0:
            return 0.0, 0.0
        camera = self.geometry.stereo.left
        ahead = self.world.renderer.distance_ahead(pose)
        step = np.asarray(true.velocity) * gap @ pose.rotation
        return float(-camera.fx * step[1] / ahead), float(-camera.fy * step[2] / ahead)

    def set_laser(self, on: bool) -> None:
        """Arm or disarm the laser, at once: the event loop asks, and must not wait until an image is drawn."""
        self._laser_armed = on

    def close(self) -> None:
        """Nothing to release."""
        self.set_laser(False)
