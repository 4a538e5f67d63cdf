"""What the vehicle's messages say, kept up to date on the link's own thread: a table of messages and what each
changes."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf, nan
from typing import Any

import numpy as np

from flight import px4_modes
from flight.autopilot import Telemetry, VehiclePose
from flight.gimbal import ProcessGimbal, angles_from
from flight.pose_history import PoseHistory
from flight.stamps import StampMap

Fields = Mapping[str, Any]

AUTOPILOT = 1
SILENT_S = 2.0  # wall seconds without a message until the vehicle counts as not connected
_PREARM_CHECK = 1 << 28
_ARMED = 1 << 7
_ON_GROUND = 1
_SET_MODE = 176


@dataclass(frozen=True)
class Arrival:
    """When a message came, on the executive's clock and on a wall clock, and from which component."""

    clock_s: float
    wall_s: float
    component: int


class TelemetryIntake:
    """`receive` is called on the link's thread, everything else from anywhere."""

    def __init__(self, now: Callable[[], float], on_status_text: Callable[[str, str], None] | None = None) -> None:
        self._now = now
        self._on_status_text = on_status_text
        self._lock = threading.RLock()  # a listener for status texts may ask for telemetry
        self._stamps: dict[int, StampMap] = {}
        self._last_wall_s = -inf
        self._range: tuple[float, float | None] = (-inf, None)
        self.last_boot: tuple[float, float] | None = None  # the autopilot's clock, and when it said so by the wall's
        self.poses = PoseHistory()
        self.process_gimbal: ProcessGimbal | None = None
        self.gimbal_heard = False
        self.armed = self.armable = self.in_air = False
        self.mode = "UNKNOWN"
        self.battery_percent = self.position_sigma_m = nan
        self.wind: tuple[float, float] | None = None
        self.global_position: tuple[float, float, float] | None = None
        self.mode_answers: deque[int] = deque(maxlen=8)
        self.last_text = ""
        self._heartbeats = 0

    def receive(self, name: str, component: int, fields: Fields) -> None:
        """Take in one message."""
        handler, autopilot_only = HANDLERS[name]
        if autopilot_only and component != AUTOPILOT:
            return
        arrival = Arrival(self._now(), time.monotonic(), component)
        with self._lock:
            if component == AUTOPILOT:
                self._last_wall_s = arrival.wall_s
            handler(self, fields, arrival)

    def boot_ms(self, stamp_s: float) -> int:
        """The vehicle's time since boot at a time on the executive's clock, as setpoints carry it."""
        stamps = self._stamps.get(AUTOPILOT)
        return 0 if stamps is None else max(0, round(stamps.boot_of(stamp_s) * 1e3)) & 0xFFFFFFFF

    @property
    def heard(self) -> bool:
        """Whether there is a heartbeat, a position and an attitude to go by."""
        with self._lock:
            return self._heartbeats > 0 and self.poses.latest() is not None

    def pose_at(self, stamp_s: float) -> VehiclePose | None:
        """The pose interpolated at a time on the executive's clock."""
        with self._lock:
            return self._with_gimbal(self.poses.at(stamp_s))

    def telemetry(self) -> Telemetry:
        """The latest of everything."""
        with self._lock:
            pose = self._with_gimbal(self.poses.latest())
            age = time.monotonic() - self._last_wall_s
            range_s, range_m = self._range
            return Telemetry(
                pose=pose if pose is not None else _NOWHERE,
                connected=age < SILENT_S,
                link_age_s=age,
                armed=self.armed,
                in_air=self.in_air,
                flight_mode=self.mode,
                armable=self.armable,
                battery_percent=self.battery_percent,
                wind=None if self.wind is None else np.array(self.wind),
                range_m=range_m,
                range_age_s=max(0.0, self._now() - range_s),
                global_position=None if self.global_position is None else np.array(self.global_position),
                position_sigma_m=self.position_sigma_m,
            )

    def _with_gimbal(self, pose: VehiclePose | None) -> VehiclePose | None:
        if pose is None or self.process_gimbal is None:
            return pose
        angles = np.array(self.process_gimbal.at(pose.stamp_s))
        return VehiclePose(pose.stamp_s, pose.position, pose.velocity, pose.attitude, angles)

    def _stamp(self, fields: Fields, arrival: Arrival) -> float:
        """On the executive's clock. Each component has a clock of its own."""
        if arrival.component == AUTOPILOT:
            self.last_boot = fields["time_boot_ms"] / 1e3, arrival.wall_s
        stamps = self._stamps.setdefault(arrival.component, StampMap())
        stamp, restarted = stamps.map(fields["time_boot_ms"] / 1e3, arrival.clock_s, arrival.wall_s)
        if restarted and arrival.component == AUTOPILOT:
            self.poses.clear()
        return stamp

    def _heartbeat(self, fields: Fields, arrival: Arrival) -> None:
        self._heartbeats += 1
        self.armed = bool(fields["base_mode"] & _ARMED)
        self.mode = px4_modes.name_of(fields["custom_mode"])

    def _current_mode(self, fields: Fields, arrival: Arrival) -> None:
        self.mode = px4_modes.name_of(fields["custom_mode"])

    def _position(self, fields: Fields, arrival: Arrival) -> None:
        values = tuple(float(fields[key]) for key in ("x", "y", "z", "vx", "vy", "vz"))
        self.poses.position.add(self._stamp(fields, arrival), values)

    def _attitude(self, fields: Fields, arrival: Arrival) -> None:
        values = tuple(float(fields[key]) for key in ("roll", "pitch", "yaw"))
        self.poses.attitude.add(self._stamp(fields, arrival), values)

    def _gimbal(self, fields: Fields, arrival: Arrival) -> None:
        self.gimbal_heard = True
        last = self.poses.attitude.last
        if last is not None and None not in fields["q"]:
            self.poses.gimbal.add(
                self._stamp(fields, arrival), angles_from(tuple(fields["q"]), fields["flags"], last[1][2])
            )

    def _range_finder(self, fields: Fields, arrival: Arrival) -> None:
        forward = fields["orientation"] == 0
        if forward:
            within = fields["min_distance"] <= fields["current_distance"] < fields["max_distance"]
            valid = within and fields.get("signal_quality", 0) != 1
            self._range = arrival.clock_s, fields["current_distance"] / 100 if valid else None

    def _wind(self, fields: Fields, arrival: Arrival) -> None:
        north, east = fields["wind_x"], fields["wind_y"]
        self.wind = None if north is None or east is None else (north, east)

    def _system_status(self, fields: Fields, arrival: Arrival) -> None:
        self.armable = bool(fields["onboard_control_sensors_health"] & _PREARM_CHECK)
        self._battery(fields, arrival)

    def _battery(self, fields: Fields, arrival: Arrival) -> None:
        if fields["battery_remaining"] >= 0:
            self.battery_percent = float(fields["battery_remaining"])

    def _landed_state(self, fields: Fields, arrival: Arrival) -> None:
        self.in_air = fields["landed_state"] > _ON_GROUND

    def _global_position(self, fields: Fields, arrival: Arrival) -> None:
        self.global_position = fields["lat"] / 1e7, fields["lon"] / 1e7, fields["alt"] / 1e3

    def _estimator(self, fields: Fields, arrival: Arrival) -> None:
        sigma = fields["pos_horiz_accuracy"]
        self.position_sigma_m = nan if sigma is None else float(sigma)

    def _command_ack(self, fields: Fields, arrival: Arrival) -> None:
        if fields["command"] == _SET_MODE:
            self.mode_answers.append(int(fields["result"]))

    def _status_text(self, fields: Fields, arrival: Arrival) -> None:
        self.last_text = str(fields["text"])
        if self._on_status_text is not None:
            self._on_status_text(_SEVERITIES[min(int(fields["severity"]), 7)], self.last_text)


_SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
_NOWHERE = VehiclePose(nan, np.full(3, nan), np.full(3, nan), np.full(3, nan), np.full(2, nan))

HANDLERS: Mapping[str, tuple[Callable[[TelemetryIntake, Fields, Arrival], None], bool]] = {
    "HEARTBEAT": (TelemetryIntake._heartbeat, True),
    "CURRENT_MODE": (TelemetryIntake._current_mode, True),
    "LOCAL_POSITION_NED": (TelemetryIntake._position, True),
    "ATTITUDE": (TelemetryIntake._attitude, True),
    "GIMBAL_DEVICE_ATTITUDE_STATUS": (TelemetryIntake._gimbal, False),
    "DISTANCE_SENSOR": (TelemetryIntake._range_finder, False),
    "WIND_COV": (TelemetryIntake._wind, True),
    "SYS_STATUS": (TelemetryIntake._system_status, True),
    "BATTERY_STATUS": (TelemetryIntake._battery, True),
    "EXTENDED_SYS_STATE": (TelemetryIntake._landed_state, True),
    "GLOBAL_POSITION_INT": (TelemetryIntake._global_position, True),
    "ESTIMATOR_STATUS": (TelemetryIntake._estimator, True),
    "COMMAND_ACK": (TelemetryIntake._command_ack, True),
    "STATUSTEXT": (TelemetryIntake._status_text, True),
}
