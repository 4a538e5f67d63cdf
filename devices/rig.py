"""The rig: what takes pictures and throws dots. One Protocol; drivers, recordings and the simulated world stand
side by side."""

from __future__ import annotations

from typing import Protocol

from vision.camera import RigGeometry
from vision.capture import StereoFrames


class CaptureError(RuntimeError):
    """The rig delivered nothing this time; the message says why. Worth another try."""


class Rig(Protocol):
    """A stereo camera pair with a switched laser.

    `capture` blocks for as long as an exposure takes and is called from the vision thread alone. `simulated` says
    that no real light is involved.
    """

    geometry: RigGeometry
    simulated: bool

    def capture(self, laser: bool = True) -> StereoFrames:
        """One set of frames, stamped on the executive's clock, `pose` None. Without `laser` the laser-on images are
        None.

        Raises:
            CaptureError: no images this time.
        """
        ...

    def set_laser(self, on: bool) -> None:
        """Arm or disarm the laser; disarmed, `capture(laser=True)` raises CaptureError."""
        ...

    def close(self) -> None:
        """Release the hardware. The laser is off afterwards."""
        ...
