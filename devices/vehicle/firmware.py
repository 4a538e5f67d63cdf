"""The autopilot's judgement: arming gate, flight modes, take-off and landing, failsafes. Commands come in here and
nowhere else, whether they came over MAVLink or in process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from devices.vehicle.battery import Battery
from devices.vehicle.body import Body
from devices.vehicle.control import Controller, Target
from devices.vehicle.estimator import Estimator
from devices.vehicle.failsafes import Failsafes
from devices.vehicle.gimbal import Gimbal
from devices.vehicle.land_detector import LandDetector
from devices.vehicle.modes import Flight, Flying, Hold, Land, Mode, Sticks, flying
from devices.vehicle.parameters import ParameterTable
from devices.vehicle.readiness import not_armable, not_flyable
from devices.vehicle.results import Result, Severity

_IDLE_THRUST = 1.5


class Firmware:
    """Decides what flies. `mode` is what flies now, `intended` what was last asked for, `failsafe` why they differ.

    `tick` is called every control cycle and returns the target, or None for motors that idle or stand still.
    `note(kind, **data)` records events; `say(severity, text)` is what a ground station reads.
    """

    def __init__(
        self,
        parameters: ParameterTable,
        body: Body,
        estimate: Estimator,
        controller: Controller,
        battery: Battery,
        gimbal: Gimbal,
        note: Callable[..., None],
        say: Callable[[Severity, str], None],
    ) -> None:
        self.parameters = parameters
        self._body, self._estimate, self._controller = body, estimate, controller
        self._battery, self._gimbal = battery, gimbal
        self._note, self._say = note, say
        self.flight = Flight(estimate, parameters, Sticks(), Target())
        self.target = Target()
        self.time_s = 0.0
        self.armed = False
        self.land_detector = LandDetector()
        self.mode = self.intended = Mode.HOLD
        self.failsafes = Failsafes(self, battery, note, say)
        self.terminated = False
        self.setpoint_s: float | None = None
        self.pilot_s: float | None = None
        self._flying: Flying = Hold(estimate)
        self._before_landing = Mode.HOLD
        self._take_off_down: float | None = None
        self._resets = 0

    # Commands

    def arm(self, force: bool = False) -> Result:
        """Start the motors; refused until the estimate is good and the mode can be flown."""
        if self.armed:
            return Result.ACCEPTED
        reason = None if force else self.not_armable
        if reason is not None:
            self._say(Severity.CRITICAL, f"Arming denied: {reason}")
            self._note("arming_denied", reason=reason)
            return Result.TEMPORARILY_REJECTED
        self.armed, self.terminated = True, False
        self.land_detector.arm(self.time_s)
        estimate = self._estimate
        self.flight.home = (estimate.n, estimate.e, estimate.d)
        self._controller.reset(estimate)
        self.enter(self.mode)
        self._note("armed")
        self._say(Severity.INFO, "Armed by external command")
        return Result.ACCEPTED

    def disarm(self, force: bool = False) -> Result:
        """Stop the motors; refused in the air unless forced."""
        if self.armed and not self.landed and not force:
            self._say(Severity.CRITICAL, "Disarming denied: not landed")
            return Result.TEMPORARILY_REJECTED
        if self.armed:
            self.drop("command")
        return Result.ACCEPTED

    def set_mode(self, mode: Mode) -> Result:
        """Ask for a flight mode, as a companion or a ground station does."""
        reason = not_flyable(self, mode) if self.armed else None
        if reason is not None:
            self._say(Severity.WARNING, f"Switching to {mode.name} is currently not available: {reason}")
            self._note("mode_refused", mode=mode.name, reason=reason)
            return Result.TEMPORARILY_REJECTED
        self._intend(mode)
        return Result.ACCEPTED

    def take_off(self, down_m: float | None = None) -> Result:
        """TAKEOFF mode toward a local height (NED down); at least, and without one, to MIS_TAKEOFF_ALT above home."""
        self._take_off_down = down_m
        return self.set_mode(Mode.TAKEOFF)

    def reposition(self, north_m: float, east_m: float, down_m: float, yaw: float) -> Result:
        """Hold, but over there. NaN keeps what is."""
        result = self.set_mode(Mode.HOLD)
        if result is Result.ACCEPTED and isinstance(self._flying, Hold):
            self._flying.move_to(north_m, east_m, down_m, yaw)
        return result

    def offboard_setpoint(self, setpoint: Target) -> None:
        """A setpoint from the companion computer, now."""
        setpoint.ask_only_for_numbers()
        limits = self.parameters
        setpoint.speed_max = float(limits["MPC_XY_VEL_MAX"])
        setpoint.climb_max = float(limits["MPC_Z_VEL_MAX_UP"])
        setpoint.sink_max = float(limits["MPC_Z_VEL_MAX_DN"])
        self.flight.setpoint = setpoint
        self.setpoint_s = self.time_s

    def pilot(self, sticks: Sticks) -> None:
        """Sticks of a remote control; a firm push takes over from an automatic mode as COM_RC_OVERRIDE says."""
        self.flight.sticks = sticks
        self.pilot_s = self.time_s
        override = int(self.parameters["COM_RC_OVERRIDE"])
        allowed = (self.mode.automatic and override & 1) or (self.mode is Mode.OFFBOARD and override & 2)
        if allowed and not self.landed and max(abs(sticks.pitch), abs(sticks.roll)) > 0.5:
            self.pilot_takes_over(Mode.POSCTL)

    def pilot_takes_over(self, mode: Mode) -> None:
        """The pilot flips the mode switch of the remote control: always obeyed."""
        self.pilot_s = self.time_s
        self._note("pilot", mode=mode.name)
        self._intend(mode)

    # State

    @property
    def landed(self) -> bool:
        """Whether it stands on the ground."""
        return self.land_detector.landed

    @property
    def failsafe(self) -> str | None:
        """Why `mode` is not what is intended."""
        return self.failsafes.reason

    @property
    def has_pilot(self) -> bool:
        """Whether a remote control is there (once taken over, it stays)."""
        return self.pilot_s is not None

    @property
    def offboard_fresh(self) -> bool:
        """Whether the last setpoint is younger than COM_OF_LOSS_T."""
        limit = float(self.parameters["COM_OF_LOSS_T"])
        return self.setpoint_s is not None and self.time_s - self.setpoint_s <= limit

    @property
    def not_armable(self) -> str | None:
        """Why it would refuse to arm, None when it would not."""
        return not_armable(self, self._battery)

    # Every control cycle

    def tick(self, seconds: float) -> Target | None:
        """One control cycle: failsafes, mode, target."""
        self.time_s += seconds
        if self._estimate.resets != self._resets:
            self._resets = self._estimate.resets
            self._flying.shift(*self._estimate.last_jump)
        self.failsafes.watch_datalink()
        if not self.armed:
            self._body.thrust_command = 0.0
            return None
        self.failsafes.watch_offboard()
        self.failsafes.watch_battery()
        target = self.target = self._flying.target(self.flight, seconds)
        if self._flying.done:
            self._enter_next()
        if self._rests(target, seconds):
            self._body.thrust_command = 0.0 if not self.armed else _IDLE_THRUST
            return None
        return target

    def _rests(self, target: Target, seconds: float) -> bool:
        """Whether the vehicle is on the ground, with idle motors or none."""
        ground, body = self.land_detector, self._body
        upward = target.vd < -0.05 or (target.d == target.d and target.d < self._estimate.d - 0.2)
        if ground.landed:
            spooled = self.time_s - ground.armed_s >= float(self.parameters["COM_SPOOLUP_TIME"])
            if upward and spooled and self.mode not in (Mode.HOLD, Mode.LAND, Mode.RTL):
                ground.leave()
                self._note("takeoff")
                return False
            wait = float(self.parameters["COM_DISARM_LAND" if ground.flown else "COM_DISARM_PRFLT"])
            if self.time_s - ground.landed_s >= wait > 0:
                self.drop("auto")
            return True
        ground.taking_off = self.mode is Mode.TAKEOFF
        if not ground.touches_down(body.on_ground and not upward, self.time_s, seconds):
            return False
        self._note("landed", impact_m_s=round(body.impact_m_s, 3))
        self._say(Severity.INFO, "Landing detected")
        self._gimbal.release()
        return True

    # Mode changes

    def _intend(self, mode: Mode) -> None:
        if mode in (Mode.LAND, Mode.RTL) and self.intended not in (Mode.LAND, Mode.RTL):
            self._before_landing = Mode.HOLD if self.intended is Mode.TAKEOFF else self.intended
        self.intended = mode
        self.failsafes.end()
        self.enter(mode)

    def _enter_next(self) -> None:
        if self.mode is Mode.TAKEOFF:
            self._intend(Mode.HOLD)
        elif self.mode is Mode.RTL and not isinstance(self._flying, Land):
            self._flying = Land(self._estimate)

    def enter(self, mode: Mode) -> None:
        """Fly another mode from now on, whatever is intended."""
        if mode is not self.mode:
            self._note("mode", mode=mode.name, before=self.mode.name, failsafe=self.failsafe)
        self.mode = mode
        down = self.flight.home[2] - float(self.parameters["MIS_TAKEOFF_ALT"])
        if self._take_off_down is not None:
            down = min(self._take_off_down, down)
        self._flying = flying(mode, self.flight, down if self.landed else min(down, self._estimate.d))

    def drop(self, by: str) -> None:
        """Stop the motors, wherever the vehicle is."""
        self.armed = False
        self._body.thrust_command = 0.0
        if self.mode in (Mode.LAND, Mode.RTL) or self.failsafe is not None:
            restored = self.intended if self.intended not in (Mode.LAND, Mode.RTL) else self._before_landing
            self.failsafes.reason = None
            self.intended = restored
            self.enter(restored)
        self.failsafes.forget_battery()
        self._note("disarmed", by=by)
        self._say(Severity.INFO, f"Disarmed by {by}")

    def describe(self) -> dict[str, Any]:
        """What a log line wants to know."""
        return {"mode": self.mode.name, "armed": self.armed, "landed": self.landed, "failsafe": self.failsafe}
