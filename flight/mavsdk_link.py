"""PX4 over MAVSDK: the Autopilot protocol on a real socket.

Setpoints, gimbal angles, modes and telemetry go through MAVSDK's `mavlink_direct`, for two reasons: its offboard plugin
re-sends the last setpoint from a thread of its own and so hides a hung program from the autopilot's failsafe, and its
telemetry carries no time stamps, without which a picture cannot be given the pose that it was taken from.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any, Literal, Protocol

from flight import px4_modes
from flight.autopilot import AutopilotError, Setpoint, Telemetry, VehiclePose
from flight.gimbal import ProcessGimbal, attitude_message
from flight.mavlink_channel import AUTOPILOT, MavlinkChannel
from flight.mavsdk_parameters import read_parameters, write_parameter
from flight.message_streams import keep_streams, request_streams
from flight.telemetry_intake import HANDLERS, TelemetryIntake

_SET_MODE, _TAKE_GIMBAL = 176, 1001
_CUSTOM_MODE_ENABLED = 1
_POSITION_AND_YAW = 0b1001_1111_1000  # ignore velocity, acceleration and yaw rate
_LOCAL_NED = 1
_STREAM_S = 0.05
_MODE_S = 3.0
_TELEMETRY_S = 10.0


class Clock(Protocol):
    """What the link needs of the executive's clock."""

    speed: float

    def now(self) -> float: ...


class MavsdkAutopilot:
    """Implements flight.autopilot.Autopilot: `MavsdkAutopilot("udpin://0.0.0.0:14540", clock)`.

    simulated: no real vehicle moves. gimbal: 'mavlink', 'process' (a gimbal that exists only here, for autopilots
    without one), or 'auto', which decides when the gimbal is taken. ground_station: see `MavlinkChannel.open`.
    on_status_text(severity, text) is called on the link's thread."""

    def __init__(
        self,
        system_address: str,
        clock: Clock,
        *,
        simulated: bool = False,
        gimbal: Literal["auto", "mavlink", "process"] = "auto",
        ground_station: bool = False,
        on_status_text: Callable[[str, str], None] | None = None,
    ) -> None:
        self.simulated = simulated
        self._address, self._clock, self._gimbal_kind = system_address, clock, gimbal
        self._ground_station = ground_station
        self._intake = TelemetryIntake(clock.now, on_status_text)
        self._channel = MavlinkChannel(self._intake.receive)
        self._watcher: asyncio.Task[None] | None = None

    async def connect(self, timeout_s: float) -> None:
        """Find the vehicle and start telemetry; `timeout_s` is wall time, since an absent vehicle has no other."""
        try:
            await self._channel.open(self._address, timeout_s, HANDLERS, ground_station=self._ground_station)
            await request_streams(self._channel)
            await self._until(lambda: self._intake.heard, _TELEMETRY_S, "the autopilot sends no position and attitude")
        except BaseException:
            await self.close()
            raise
        self._watcher = asyncio.create_task(
            keep_streams(self._channel, lambda: self.telemetry.connected), name="link watch"
        )

    async def close(self) -> None:
        """Stop everything that runs on behalf of the link; idempotent."""
        watcher, self._watcher = self._watcher, None
        if watcher is not None:
            watcher.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await watcher
        await self._channel.close()

    @property
    def telemetry(self) -> Telemetry:
        """The latest telemetry. `link_age_s` is in wall seconds: a radio does not run faster with a simulation."""
        return self._intake.telemetry()

    def pose_at(self, stamp_s: float) -> VehiclePose | None:
        """The pose interpolated at a time on the executive's clock; None outside the last ten seconds."""
        return self._intake.pose_at(stamp_s)

    async def parameters(self, names: Sequence[str]) -> Mapping[str, float]:
        """Values of the autopilot's parameters; those that it does not have are left out."""
        return await read_parameters(self._channel, names)

    async def set_parameter(self, name: str, value: float) -> None:
        """Change a parameter, of whichever type it is, and read it back."""
        await write_parameter(self._channel, name, value)

    async def measured_speed(self, wall_s: float = 1.0) -> float | None:
        """The vehicle's seconds per wall second, by the stamps of its messages; None where they tell nothing."""
        before = self._intake.last_boot
        await asyncio.sleep(wall_s)
        after = self._intake.last_boot
        if before is None or after is None or after[1] - before[1] < 0.5 * wall_s or after[0] < before[0]:
            return None
        return (after[0] - before[0]) / (after[1] - before[1])

    async def arm(self) -> None:
        """Arm. PX4 refuses it in a mode that it was left in by a landing; then it is put on hold first."""
        telemetry = self.telemetry
        if telemetry.armed:
            return
        if not telemetry.armable:
            raise AutopilotError(
                f"the vehicle cannot be armed yet{self._why()}: wait for its checks, or see `mission doctor`"
            )
        if telemetry.flight_mode in ("OFFBOARD", "LAND", "RTL"):
            await self.hold()
        await self._act("arm", lambda action: action.arm())
        await self._until(lambda: self._intake.armed, _MODE_S, "the autopilot accepted to arm and did not")

    async def disarm(self) -> None:
        """Disarm; refused in the air."""
        await self._act("disarm", lambda action: action.disarm())

    async def take_off(self, height_m: float) -> None:
        """Start a take-off to a height above the ground; returns when it is accepted."""
        await self._act("set the take-off height", lambda action: action.set_takeoff_altitude(float(height_m)))
        await self._act("take off", lambda action: action.takeoff())

    async def land(self) -> None:
        """Start landing where it is; returns when accepted."""
        await self._act("land", lambda action: action.land())

    async def hold(self) -> None:
        """Switch to the autopilot's own position hold."""
        await self._set_mode("HOLD")

    async def start_offboard(self, first: Setpoint) -> None:
        """Stream `first` until the autopilot has taken OFFBOARD; PX4 refuses it without a stream."""
        mode: asyncio.Task[None] | None = None
        try:
            for sent in range(round(2 * _MODE_S / _STREAM_S)):
                self.send(first)
                if sent == 5:
                    mode = asyncio.create_task(self._set_mode("OFFBOARD"), name="offboard")
                if mode is not None and mode.done():
                    mode.result()
                    return
                await asyncio.sleep(_STREAM_S)
        finally:
            if mode is not None and not mode.done():
                mode.cancel()
        raise AutopilotError(f"OFFBOARD was not taken{self._why()}")

    def send(self, setpoint: Setpoint) -> None:
        """Send one setpoint once, now. Nothing re-sends it: when the caller stops, the stream stops (dead-man rule)."""
        north, east, down = (float(value) for value in setpoint.position)
        self._channel.send(
            "SET_POSITION_TARGET_LOCAL_NED",
            {
                "time_boot_ms": self._intake.boot_ms(self._clock.now()),
                "target_system": self._channel.system_id,
                "target_component": AUTOPILOT,
                "coordinate_frame": _LOCAL_NED,
                "type_mask": _POSITION_AND_YAW,
                **{"x": north, "y": east, "z": down, "vx": 0.0, "vy": 0.0, "vz": 0.0},
                **{"afx": 0.0, "afy": 0.0, "afz": 0.0, "yaw": float(setpoint.yaw), "yaw_rate": 0.0},
            },
        )

    async def take_gimbal(self) -> None:
        """Take control of the gimbal, or set up the one in process."""
        if self._gimbal_kind == "process" or self._intake.process_gimbal is not None:
            self._use_process_gimbal()
            return
        try:
            result = await self._channel.command(_TAKE_GIMBAL, "take the gimbal", -2, -2, -1, -1)
        except AutopilotError:
            result = -1
        if result == 0:
            heard = contextlib.suppress(AutopilotError) if self._gimbal_kind == "auto" else contextlib.nullcontext()
            with heard:
                await self._until(lambda: self._intake.gimbal_heard, _MODE_S, "the gimbal reports no angles")
                return
        elif self._gimbal_kind == "mavlink":
            answer = px4_modes.RESULTS.get(result, "no answer")
            raise AutopilotError(f"no control of the gimbal ({answer}): is MNT_MODE_IN 4, and is the gimbal on?")
        self._use_process_gimbal()

    def point_gimbal(self, yaw: float, pitch: float) -> None:
        """Send gimbal angles once, radians: yaw from north, pitch up from the horizon."""
        if self._intake.process_gimbal is not None:
            self._intake.process_gimbal.point(self._clock.now(), yaw, pitch)
        else:
            self._channel.send("GIMBAL_MANAGER_SET_ATTITUDE", attitude_message(yaw, pitch, self._channel.system_id))

    def _use_process_gimbal(self) -> None:
        if self._intake.process_gimbal is None:
            gimbal = ProcessGimbal()
            gimbal.point(self._clock.now(), float(self.telemetry.pose.attitude[2]), 0.0)
            self._intake.process_gimbal = gimbal

    async def _set_mode(self, mode: str) -> None:
        """PX4 acknowledges a mode twice, first always 'accepted' and then the truth: so the mode itself is waited
        for."""
        if self._intake.mode == mode:
            return
        main, sub = px4_modes.numbers_of(mode)
        self._intake.mode_answers.clear()
        result = await self._channel.command(_SET_MODE, f"change to {mode}", _CUSTOM_MODE_ENABLED, main, sub)

        def settled() -> bool:
            refused = [answer for answer in self._intake.mode_answers if answer != 0]
            if refused or result != 0:
                answer = px4_modes.RESULTS.get(refused[-1] if refused else result, "refused")
                raise AutopilotError(f"change to {mode}: {answer}{self._why()}")
            return self._intake.mode == mode

        await self._until(settled, _MODE_S, f"change to {mode}: accepted, but the mode stayed {self._intake.mode}")

    async def _act(self, what: str, call: Callable[[Any], Awaitable[None]]) -> None:
        """One call of MAVSDK's action plugin, its refusals in one line."""
        from mavsdk.asyncio.plugins.action import ActionAsync
        from mavsdk.plugins.action import ActionError

        try:
            await self._channel.blocking(call(ActionAsync(self._channel.system)))
        except ActionError as error:
            answer = error.result.name.lower().replace("_", " ")
            raise AutopilotError(f"{what}: {answer}{self._why()}") from None

    def _why(self) -> str:
        """The vehicle's own last words, where it has any."""
        return f" ({self._intake.last_text})" if self._intake.last_text else ""

    async def _until(self, condition: Callable[[], bool], wall_s: float, complaint: str) -> None:
        for _ in range(round(wall_s / 0.02)):
            if condition():
                return
            await asyncio.sleep(0.02)
        raise AutopilotError(complaint)
