"""The camera drivers of real rigs, by the name that a rig file calls them. A new one is a module and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from devices.rig import Rig
    from vision.camera import RigGeometry


@dataclass(frozen=True)
class Driver:
    """Where a driver is: its class in its module, made with (geometry, sources, now). text: for the rig file."""

    module: str
    name: str
    text: str


DRIVERS: Mapping[str, Driver] = {
    "none": Driver("devices.no_cameras", "NoCameras", "no cameras, for missions that need no image"),
    "opencv": Driver("devices.opencv_rig", "OpenCvRig", "two cameras that OpenCV opens; it switches no laser"),
}


def open_rig(driver: str, geometry: RigGeometry, sources: Sequence[int | str], now: Callable[[], float]) -> Rig:
    """The rig behind a driver; now: the executive's clock, which stamps the frames. Imported only when asked for.

    Raises:
        CaptureError: its hardware cannot be opened; one line for a person.
    """
    chosen = DRIVERS[driver]
    rig: Rig = getattr(import_module(chosen.module), chosen.name)(geometry, sources, now)
    return rig
