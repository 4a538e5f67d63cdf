"""The autopilot as this project sees it: what it reports and what it can be told. PX4 over MAVSDK, or the simulated
vehicle in process for lockstep time, stand behind one Protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class AutopilotError(RuntimeError):
    """The autopilot refused, or did not answer; the message is one line for a person."""


@dataclass(frozen=True)
class VehiclePose:
    """Position (3,) m and velocity (3,) m/s in local NED, attitude (3,) = roll, pitch, yaw in radians, gimbal (2,) =
    yaw, pitch in radians, yaw measured from north and pitch from the horizon (a stabilised gimbal holds both). stamp_s
    on the executive's clock."""

    stamp_s: float
    position: Array
    velocity: Array
    attitude: Array
    gimbal: Array


@dataclass(frozen=True)
class Telemetry:
    """The latest of everything; NaN or None where the autopilot has not said so yet."""

    pose: VehiclePose
    connected: bool
    link_age_s: float
    armed: bool
    in_air: bool
    flight_mode: str  # PX4's names: OFFBOARD, HOLD, RTL, LAND, TAKEOFF, POSCTL, MANUAL, …
    armable: bool
    battery_percent: float
    wind: Array | None  # (2,) m/s north, east, where the autopilot estimates it
    range_m: float | None  # forward range finder, None beyond its reach
    range_age_s: float
    global_position: Array | None  # (3,) latitude deg, longitude deg, altitude above mean sea level m
    position_sigma_m: float  # horizontal, as the estimator claims


@dataclass(frozen=True)
class Setpoint:
    """A position (3,) m in local NED and a yaw in radians from north."""

    position: Array
    yaw: float


class Autopilot(Protocol):
    """Every coroutine raises AutopilotError with one clear line when the vehicle refuses or stays silent."""

    simulated: bool

    async def connect(self, timeout_s: float) -> None:
        """Find the vehicle and start telemetry."""
        ...

    async def close(self) -> None:
        """Stop everything that runs on behalf of the link; idempotent."""
        ...

    @property
    def telemetry(self) -> Telemetry:
        """The latest telemetry. Cheap, never blocks."""
        ...

    def pose_at(self, stamp_s: float) -> VehiclePose | None:
        """The pose interpolated at a time on the executive's clock; None outside the last few seconds."""
        ...

    async def parameters(self, names: Sequence[str]) -> Mapping[str, float]:
        """Values of the autopilot's parameters; those that it does not have are left out."""
        ...

    async def set_parameter(self, name: str, value: float) -> None:
        """Change one of the autopilot's parameters and see that it took the value."""
        ...

    async def arm(self) -> None: ...

    async def disarm(self) -> None: ...

    async def take_off(self, height_m: float) -> None:
        """Start a take-off to a height above the ground; returns when it is accepted, not when it is done."""
        ...

    async def land(self) -> None:
        """Start landing where it is; returns when accepted."""
        ...

    async def hold(self) -> None:
        """Switch to the autopilot's own position hold."""
        ...

    async def start_offboard(self, first: Setpoint) -> None:
        """Stream `first` until the autopilot has taken OFFBOARD, then return; `send` must follow within a second."""
        ...

    def send(self, setpoint: Setpoint) -> None:
        """Send one setpoint once, now. Nothing re-sends it: when the caller stops, the stream stops (dead-man rule)."""
        ...

    async def take_gimbal(self) -> None:
        """Take control of the gimbal."""
        ...

    def point_gimbal(self, yaw: float, pitch: float) -> None:
        """Send gimbal angles once, radians: yaw from north, pitch up from the horizon."""
        ...
