"""The volume that no setpoint may enter: rotor, hub, nacelle and tower, grown by a clearance and by what is not known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flight.turbine import Turbine
from vision.estimate import BladeEstimate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class KeepOut:
    """turbine as believed; clearance_m from any of its surfaces to the vehicle's reference point."""

    turbine: Turbine
    clearance_m: float = 2.0

    def distance(self, point: Array) -> float:
        """Metres from a point (3,) of local NED to the volume; negative inside."""
        raise NotImplementedError

    def inside(self, point: Array) -> bool:
        """Whether a point (3,) of local NED lies in the volume."""
        raise NotImplementedError

    def path_clear(self, start: Array, end: Array) -> bool:
        """Whether the straight way between two points (3,) stays out of the volume."""
        raise NotImplementedError

    def bound(self, position: Array, current: Array) -> tuple[Array, bool]:
        """The allowed point (3,) nearest to `position` that can be reached straight from `current`, and whether it differs."""
        raise NotImplementedError

    def with_turbine(self, turbine: Turbine) -> KeepOut:
        """The volume around a refined turbine."""
        raise NotImplementedError

    def with_blade_surface(self, estimate: BladeEstimate, elapsed_s: float) -> KeepOut:
        """The volume with the inspected blade's measured surface in place of the survey's; call it at every control tick
        with the seconds since the last call."""
        raise NotImplementedError

    def without_blade_surface(self) -> KeepOut:
        """The survey's volume again, as after leaving the blade."""
        raise NotImplementedError
