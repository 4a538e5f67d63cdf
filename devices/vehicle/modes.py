"""Flight modes: PX4's numbers for them, and what each asks of the controller."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Protocol

from devices.vehicle.control import BRAKE_M_S2, HEIGHT_BRAKE_M_S2, NAN, Target

if TYPE_CHECKING:
    from devices.vehicle.estimator import Estimator
    from devices.vehicle.parameters import ParameterTable

_STICK_TILT_SPEED_M_S = 8.0
_STICK_YAW_RATE = math.radians(90.0)
_STICK_DEADBAND = 0.05
_TAKE_OFF_SLOWDOWN_1_S = 0.6


class Mode(Enum):
    """Name, with PX4's main and sub mode."""

    MANUAL = (1, 0)
    ALTCTL = (2, 0)
    POSCTL = (3, 0)
    TAKEOFF = (4, 2)
    HOLD = (4, 3)
    MISSION = (4, 4)
    RTL = (4, 5)
    LAND = (4, 6)
    ACRO = (5, 0)
    OFFBOARD = (6, 0)
    STABILIZED = (7, 0)

    def __init__(self, main: int, sub: int) -> None:
        self.main, self.sub = main, sub

    @property
    def custom(self) -> int:
        """`custom_mode` of HEARTBEAT and CURRENT_MODE."""
        return self.main << 16 | self.sub << 24

    @property
    def piloted(self) -> bool:
        """A person with sticks flies it."""
        return self in (Mode.MANUAL, Mode.ALTCTL, Mode.POSCTL, Mode.ACRO, Mode.STABILIZED)

    @property
    def automatic(self) -> bool:
        """The autopilot flies on its own."""
        return self.main == 4

    @classmethod
    def of(cls, main: int, sub: int) -> Mode | None:
        """The mode with these numbers, None if there is none."""
        return next((mode for mode in cls if mode.value == (main, sub if main == 4 else 0)), None)


@dataclass
class Sticks:
    """A pilot's sticks, each from -1 to 1: pitch forward, roll right, throttle up from the middle, yaw right."""

    pitch: float = 0.0
    roll: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0


@dataclass
class Flight:
    """What a mode may look at."""

    estimate: Estimator
    parameters: ParameterTable
    sticks: Sticks
    setpoint: Target
    home: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Flying(Protocol):
    """One mode at work. `done` once there is nothing left to do; `shift` follows a jump of the estimate."""

    done: bool

    def target(self, flight: Flight, seconds: float) -> Target: ...

    def shift(self, north_m: float, east_m: float, down_m: float) -> None: ...


class _Spot:
    """A place to stay at, which moves with the estimate when that jumps."""

    def __init__(self, estimate: Estimator) -> None:
        speed = math.hypot(estimate.vn, estimate.ve)
        reach = speed / (2 * BRAKE_M_S2) if speed > 0.3 else 0.0
        fall = abs(estimate.vd) / (2 * HEIGHT_BRAKE_M_S2) if abs(estimate.vd) > 0.3 else 0.0
        self.done = False
        self.n = estimate.n + reach * estimate.vn
        self.e = estimate.e + reach * estimate.ve
        self.d = estimate.d + fall * estimate.vd
        self.yaw = NAN

    def shift(self, north_m: float, east_m: float, down_m: float) -> None:
        self.n += north_m
        self.e += east_m
        self.d += down_m


class Hold(_Spot):
    """Stop and stay; or go to a place that DO_REPOSITION names."""

    def target(self, flight: Flight, seconds: float) -> Target:
        p = flight.parameters
        return Target(self.n, self.e, self.d, yaw=self.yaw, speed_max=float(p["MPC_XY_CRUISE"]))

    def move_to(self, north_m: float, east_m: float, down_m: float, yaw: float) -> None:
        """Stay over there. NaN keeps what is, but a yaw that was asked for before."""
        self.n = north_m if math.isfinite(north_m) else self.n
        self.e = east_m if math.isfinite(east_m) else self.e
        self.d = down_m if math.isfinite(down_m) else self.d
        self.yaw = yaw if math.isfinite(yaw) else NAN


class TakeOff(_Spot):
    """Straight up, at a speed that grows with the ramp."""

    def __init__(self, estimate: Estimator, down_m: float) -> None:
        super().__init__(estimate)
        self.d = down_m
        self._since_s = 0.0

    def target(self, flight: Flight, seconds: float) -> Target:
        self._since_s += seconds
        p = flight.parameters
        ramp = min(self._since_s / max(float(p["MPC_TKO_RAMP_T"]), 0.1), 1.0)
        left = flight.estimate.d - self.d
        self.done = left < 0.15
        speed = min(float(p["MPC_TKO_SPEED"]) * ramp, max(_TAKE_OFF_SLOWDOWN_1_S * left, 0.1))
        return Target(self.n, self.e, self.d, climb_max=speed)


class Land(_Spot):
    """Straight down, slower near the ground."""

    def target(self, flight: Flight, seconds: float) -> Target:
        p = flight.parameters
        fast, slow = float(p["MPC_Z_VEL_MAX_DN"]), float(p["MPC_LAND_SPEED"])
        high, low = float(p["MPC_LAND_ALT1"]), float(p["MPC_LAND_ALT2"])
        height = flight.home[2] - flight.estimate.d
        share = min(max((height - low) / max(high - low, 0.1), 0.0), 1.0)
        speed = slow + share * (fast - slow) if height > float(p["MPC_LAND_ALT3"]) else float(p["MPC_LAND_CRWL"])
        return Target(self.n, self.e, NAN, vd=speed, sink_max=fast)


class ReturnHome(_Spot):
    """Climb, fly a straight line home, descend, land."""

    def __init__(self, flight: Flight) -> None:
        super().__init__(flight.estimate)
        away = math.hypot(self.n - flight.home[0], self.e - flight.home[1])
        cone = math.tan(math.radians(float(flight.parameters["RTL_CONE_ANG"])))
        height = min(float(flight.parameters["RTL_RETURN_ALT"]), max(away / max(cone, 0.01), 10.0))
        self.d = min(flight.home[2] - height, flight.estimate.d)
        self._phase = "climb"

    def target(self, flight: Flight, seconds: float) -> Target:
        p, estimate = flight.parameters, flight.estimate
        if self._phase == "climb" and estimate.d - self.d < 0.5:
            self._phase = "return"
            self.n, self.e = flight.home[0], flight.home[1]
            self.yaw = math.atan2(self.e - estimate.e, self.n - estimate.n)
        if self._phase == "return" and math.hypot(self.n - estimate.n, self.e - estimate.e) < 0.7:
            self._phase = "descend"
            self.d = max(self.d, flight.home[2] - float(p["RTL_DESCEND_ALT"]))
            self.yaw = NAN
        if self._phase == "descend" and self.d - estimate.d < 0.5:
            self.done = True
        return Target(self.n, self.e, self.d, yaw=self.yaw, speed_max=float(p["MPC_XY_CRUISE"]))


class Offboard(_Spot):
    """Whatever the companion computer last asked for."""

    def target(self, flight: Flight, seconds: float) -> Target:
        return flight.setpoint

    def shift(self, north_m: float, east_m: float, down_m: float) -> None:
        """Offboard setpoints are the companion's: they do not move with the estimate."""


class Piloted(_Spot):
    """Sticks steer velocity and turn rate; centred sticks hold the place (MANUAL drifts with the wind instead)."""

    def __init__(self, estimate: Estimator, holds_place: bool) -> None:
        super().__init__(estimate)
        self._holds_place = holds_place

    def target(self, flight: Flight, seconds: float) -> Target:
        sticks, estimate = flight.sticks, flight.estimate
        forward, right = (_STICK_TILT_SPEED_M_S * _beyond(value) for value in (sticks.pitch, sticks.roll))
        cy, sy = math.cos(estimate.yaw), math.sin(estimate.yaw)
        target = Target(
            vn=forward * cy - right * sy,
            ve=forward * sy + right * cy,
            vd=-3.0 * _beyond(sticks.throttle),
            yaw_rate=_STICK_YAW_RATE * _beyond(sticks.yaw),
        )
        if forward or right or not self._holds_place:
            spot = _Spot(estimate)
            self.n, self.e = spot.n, spot.e
        else:
            target.n, target.e = self.n, self.e
        if target.vd:
            self.d = _Spot(estimate).d
        else:
            target.d = self.d
        return target


def _beyond(stick: float) -> float:
    return stick if abs(stick) > _STICK_DEADBAND else 0.0


def flying(mode: Mode, flight: Flight, take_off_down_m: float) -> Flying:
    """A mode, begun now; modes that nothing here flies hold."""
    estimate = flight.estimate
    if mode is Mode.TAKEOFF:
        return TakeOff(estimate, take_off_down_m)
    if mode is Mode.LAND:
        return Land(estimate)
    if mode is Mode.RTL:
        return ReturnHome(flight)
    if mode is Mode.OFFBOARD:
        return Offboard(estimate)
    if mode.piloted:
        return Piloted(estimate, holds_place=mode is Mode.POSCTL)
    return Hold(estimate)
