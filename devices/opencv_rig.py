"""Two cameras that OpenCV can open, side by side: USB and CSI cameras, network streams, or video files."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from devices.rig import CaptureError
from vision.camera import Camera, RigGeometry
from vision.capture import Image, StereoFrames

logger = logging.getLogger(__name__)

QUEUED_MAX = 6  # pictures that a driver keeps back although it was asked for one
AT_ONCE_S = 0.004  # a picture that comes faster than this lay waiting and is old


class OpenCvRig:
    """A left and a right camera. Implements `devices.rig.Rig`.

    sources: left and right, each a camera's number, a device, a stream's address or a file. now: the clock that stamps
    the frames. Nothing here switches a laser, so the laser-on images are always None. The cameras expose one right
    after the other, not at one instant: hover, or let hardware trigger them together.

    Raises:
        CaptureError: a camera cannot be opened; one line for a person.
    """

    simulated = False

    def __init__(self, geometry: RigGeometry, sources: Sequence[int | str], now: Callable[[], float]) -> None:
        self.geometry = geometry
        self._now = now
        self._lock = threading.Lock()
        self._laser_armed = True
        self._cameras: list[cv2.VideoCapture] = []
        self._sources = tuple(sources)
        for source in self._sources:
            camera = cv2.VideoCapture(source)
            self._cameras.append(camera)
            if not camera.isOpened():
                self.close()
                raise CaptureError(
                    f"camera {source!r} cannot be opened: is it plugged in, and does nobody else use it?"
                )
            camera.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        logger.warning("this rig has no laser switch: its pictures are taken with the laser off")

    def capture(self, laser: bool = True) -> StereoFrames:
        """One pair of pictures with the laser off; CaptureError when a camera delivers none, or of another size."""
        with self._lock:
            if not self._cameras:
                raise CaptureError("the cameras are closed")
            if laser and not self._laser_armed:
                raise CaptureError("the laser is not armed")
            for source, camera in zip(self._sources, self._cameras, strict=True):
                if not _grab_newest(camera, live=_is_live(source)):
                    raise CaptureError(f"camera {source!r} delivers no picture")
            stamp_s = self._now()
            stereo = self.geometry.stereo
            left, right = (
                _picture(source, camera, lens)
                for source, camera, lens in zip(self._sources, self._cameras, (stereo.left, stereo.right), strict=True)
            )
            return StereoFrames(stamp_s, left, right)

    def set_laser(self, on: bool) -> None:
        """Remembered, although there is no switch."""
        with self._lock:
            self._laser_armed = on

    def close(self) -> None:
        """Release both cameras; idempotent."""
        with self._lock:
            for camera in self._cameras:
                camera.release()
            self._cameras = []


def _is_live(source: int | str) -> bool:
    return isinstance(source, int) or source.startswith("/dev/") or "://" in source


def _grab_newest(camera: cv2.VideoCapture, live: bool) -> bool:
    """Take the next picture; of a camera, leave out those that lay in its queue since the last time."""
    for _ in range(QUEUED_MAX):
        began_s = time.monotonic()
        if not camera.grab():
            return False
        if not live or time.monotonic() - began_s > AT_ONCE_S:
            return True
    return True


def _picture(source: int | str, camera: cv2.VideoCapture, lens: Camera) -> Image:
    taken, image = camera.retrieve()
    if not taken or image is None:
        raise CaptureError(f"camera {source!r} delivers no picture")
    height, width = image.shape[:2]
    if (width, height) != (lens.width, lens.height):
        raise CaptureError(
            f"camera {source!r} delivers {width} × {height} px, the rig file says {lens.width} × {lens.height}"
        )
    return np.ascontiguousarray(image, np.uint8)
