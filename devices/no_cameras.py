"""A rig without cameras: enough to fly missions that need no image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NoReturn

from devices.rig import CaptureError
from vision.camera import RigGeometry


class NoCameras:
    """Nothing that looks. Implements `devices.rig.Rig`."""

    simulated = False

    def __init__(
        self, geometry: RigGeometry, sources: Sequence[int | str] = (), now: Callable[[], float] | None = None
    ) -> None:
        self.geometry = geometry

    def capture(self, laser: bool = True) -> NoReturn:
        """Always CaptureError."""
        raise CaptureError("this rig has no cameras")

    def set_laser(self, on: bool) -> None:
        """There is none."""

    def close(self) -> None:
        """Nothing to release."""
