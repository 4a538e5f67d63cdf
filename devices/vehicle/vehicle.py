"""The whole simulated vehicle without any I/O: a body in the wind, what it believes, and what flies it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.vehicle.battery import Battery
from devices.vehicle.body import STEP_S, Body
from devices.vehicle.control import Controller, Target
from devices.vehicle.estimator import Estimator
from devices.vehicle.firmware import Firmware
from devices.vehicle.gimbal import Gimbal
from devices.vehicle.modes import Mode
from devices.vehicle.parameters import ParameterTable
from devices.vehicle.results import Result, Severity
from devices.vehicle.settings import VehicleSettings
from devices.vehicle.wind import WindField

Array = NDArray[np.float64]
ForwardRange = Callable[[Array, Array], float | None]
"""(position (3,) m true local NED, attitude (3,) roll, pitch, yaw rad) → metres to what is ahead, None beyond reach."""

TICK_STEPS = 5
TICK_S = TICK_STEPS * STEP_S
_RANGE_EVERY_TICKS = 5
_RANGE_NOISE_M = 0.02
RANGE_MIN_M, RANGE_MAX_M = 0.2, 40.0


@dataclass(frozen=True)
class TruePose:
    """The truth at one instant: simulated time, position and velocity (3,) in local NED, attitude (3,) roll, pitch,
    yaw, gimbal (2,) = yaw from north, pitch up; radians."""

    time_s: float
    position: Array
    velocity: Array
    attitude: Array
    gimbal: Array


@dataclass(frozen=True)
class VehicleEvent:
    """Something that happened on board, at a simulated time."""

    time_s: float
    kind: str
    data: dict[str, Any]


class SimulatedVehicle:
    """A quadrotor with a PX4-like autopilot. `step` moves it on in whole steps of 4 ms; the same seed and the same
    commands at the same times give the same flight, bit for bit.

    Commands go to `firmware`, gimbal angles to `gimbal`. What the autopilot reports is `estimate`, `battery`,
    `gimbal.reading`, `range_m`, `wind_estimate`; what is true is `pose()`, which no estimate may look at.
    """

    def __init__(self, settings: VehicleSettings, seed: int, forward_range: ForwardRange | None = None) -> None:
        wind_rng, estimate_rng, gimbal_rng, self._range_rng = (
            np.random.Generator(np.random.PCG64(sequence)) for sequence in np.random.SeedSequence(seed).spawn(4)
        )
        self.settings = settings
        self.forward_range = forward_range
        yaw = math.radians(settings.heading_deg)
        self.body = Body(settings.airframe, yaw)
        self.wind = WindField(settings.wind, wind_rng)
        self.estimate = Estimator(settings.gps, math.radians(settings.airframe.yaw_bias_deg), estimate_rng)
        self.controller = Controller(settings.airframe)
        self.battery = Battery(settings.aircraft.battery_percent, settings.aircraft.battery_minutes)
        self.gimbal = Gimbal(settings.aircraft, yaw, gimbal_rng)
        self.events: list[VehicleEvent] = []
        self.texts: list[tuple[Severity, str]] = []
        self.firmware = Firmware(
            ParameterTable(settings.parameters, settings.time_factor),
            self.body,
            self.estimate,
            self.controller,
            self.battery,
            self.gimbal,
            self._note,
            lambda severity, text: self.texts.append((severity, text)),
        )
        self.range_m: float | None = None
        self.range_working = True
        self.wind_estimate = (0.0, 0.0)
        self._steps = 0
        self._owed_s = 0.0
        self.estimate.update(self.body, TICK_S)

    @property
    def time_s(self) -> float:
        """Simulated seconds since boot."""
        return self._steps * STEP_S

    def step(self, seconds: float) -> None:
        """Let so many seconds pass; what is left of a step of 4 ms is owed to the next call."""
        self._owed_s += seconds
        body, wind = self.body, self.wind
        while self._owed_s >= STEP_S - 1e-9:
            self._owed_s -= STEP_S
            body.step(wind.velocity)
            self._steps += 1
            if self._steps % TICK_STEPS == 0:
                self._tick()

    def pose(self) -> TruePose:
        """The truth now."""
        body, gimbal = self.body, self.gimbal
        return TruePose(
            self.time_s,
            np.array([body.n, body.e, body.d]),
            np.array([body.vn, body.ve, body.vd]),
            np.array([body.roll, body.pitch, body.yaw]),
            np.array([gimbal.yaw, gimbal.pitch]),
        )

    def goto(self, north_m: float, east_m: float, down_m: float, yaw: float) -> None:
        """An offboard setpoint: a place in local NED as estimated, and a heading."""
        self.firmware.offboard_setpoint(Target(north_m, east_m, down_m, yaw=yaw))

    def set_mode(self, name: str) -> Result:
        """Ask for a flight mode by its name."""
        return self.firmware.set_mode(Mode[name])

    def gps_jump(self, north_m: float, east_m: float, down_m: float = 0.0) -> None:
        """Fault: the estimated position jumps."""
        self.estimate.jump(north_m, east_m, down_m)
        self._note("gps_jump", north_m=north_m, east_m=east_m, down_m=down_m)

    def battery_drop(self, percent: float) -> None:
        """Fault: the battery falls to a level."""
        self.battery.percent = min(self.battery.percent, percent)
        self._note("battery_drop", percent=percent)

    def pilot_takes_over(self, mode: str = "POSCTL") -> None:
        """A safety pilot flips the switch."""
        self.firmware.pilot_takes_over(Mode[mode])

    def _tick(self) -> None:
        body, estimate = self.body, self.estimate
        self.wind.step(TICK_S)
        estimate.update(body, TICK_S)
        target = self.firmware.tick(TICK_S)
        if target is not None:
            self.controller.update(target, estimate, body, TICK_S)
        elif self.firmware.armed:
            self.controller.reset(estimate)
        self.battery.step(self.firmware.armed, body.thrust, TICK_S)
        self.gimbal.step(body.yaw, estimate.yaw_bias, TICK_S)
        self._estimate_wind()
        if self._steps % (TICK_STEPS * _RANGE_EVERY_TICKS) == 0:
            self._measure_range()

    def _estimate_wind(self) -> None:
        wind, known = self.wind.velocity, self.wind_estimate
        share = TICK_S / 2.0 if not self.firmware.landed else TICK_S / 20.0
        self.wind_estimate = (known[0] + share * (wind[0] - known[0]), known[1] + share * (wind[1] - known[1]))

    def _measure_range(self) -> None:
        self.range_m = None
        if self.forward_range is None or not self.range_working:
            return
        body = self.body
        metres = self.forward_range(np.array([body.n, body.e, body.d]), np.array([body.roll, body.pitch, body.yaw]))
        noise = _RANGE_NOISE_M * float(self._range_rng.standard_normal())
        if metres is not None and RANGE_MIN_M < metres < RANGE_MAX_M:
            self.range_m = metres + noise

    def _note(self, kind: str, **data: Any) -> None:
        self.events.append(VehicleEvent(self.time_s, kind, data))
