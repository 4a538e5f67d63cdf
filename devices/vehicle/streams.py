"""The table of streams: which message goes out how often on which kind of link, and the clockwork that sends them."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle import gimbal_messages, motion_messages, status_messages
from devices.vehicle.udp_link import AUTOPILOT, GIMBAL, UdpLink
from devices.vehicle.vehicle import SimulatedVehicle

Build = Callable[[SimulatedVehicle], Any | None]


@dataclass(frozen=True)
class Stream:
    """Rates in Hz of simulated time on an onboard and on a ground station's link; 0: only when asked for."""

    build: Build
    onboard_hz: float
    gcs_hz: float
    component: int = AUTOPILOT


STREAMS: dict[int, Stream] = {
    mavlink.MAVLINK_MSG_ID_ATTITUDE: Stream(motion_messages.attitude, 100, 15),
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: Stream(motion_messages.highres_imu, 50, 1.5),
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: Stream(motion_messages.attitude_quaternion, 50, 10),
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: Stream(motion_messages.global_position_int, 50, 5),
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: Stream(motion_messages.local_position_ned, 30, 1),
    mavlink.MAVLINK_MSG_ID_ODOMETRY: Stream(motion_messages.odometry, 30, 3),
    mavlink.MAVLINK_MSG_ID_TIMESYNC: Stream(status_messages.timesync, 10, 1),
    mavlink.MAVLINK_MSG_ID_ALTITUDE: Stream(motion_messages.altitude, 10, 1),
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: Stream(motion_messages.distance_sensor, 10, 0.5),
    mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET: Stream(motion_messages.attitude_target, 10, 2),
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: Stream(motion_messages.position_target_local_ned, 10, 1.5),
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: Stream(motion_messages.servo_output_raw, 10, 1),
    mavlink.MAVLINK_MSG_ID_VFR_HUD: Stream(motion_messages.vfr_hud, 10, 4),
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: Stream(motion_messages.gps_raw_int, 8, 1),
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: Stream(status_messages.extended_sys_state, 5, 1),
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: Stream(status_messages.sys_status, 5, 1),
    mavlink.MAVLINK_MSG_ID_WIND_COV: Stream(motion_messages.wind_cov, 2, 0.5),
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: Stream(status_messages.heartbeat, 1, 1),
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: Stream(status_messages.estimator_status, 1, 0.5),
    mavlink.MAVLINK_MSG_ID_PING: Stream(status_messages.ping, 1, 0.1),
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: Stream(status_messages.scaled_pressure, 1, 1),
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: Stream(status_messages.system_time, 1, 1),
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: Stream(status_messages.mission_current, 1, 1),
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: Stream(status_messages.battery_status, 0.5, 0.5),
    mavlink.MAVLINK_MSG_ID_CURRENT_MODE: Stream(status_messages.current_mode, 0.5, 0.5),
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: Stream(status_messages.home_position, 0.5, 0.5),
    mavlink.MAVLINK_MSG_ID_VIBRATION: Stream(status_messages.vibration, 0.5, 0.1),
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: Stream(status_messages.gps_global_origin, 0, 0.1),
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: Stream(status_messages.autopilot_version, 0, 0),
    mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION: Stream(gimbal_messages.manager_information, 0.2, 0.2),
    mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS: Stream(gimbal_messages.manager_status, 0.5, 0.5),
    mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_INFORMATION: Stream(gimbal_messages.device_information, 0, 0, GIMBAL),
    mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: Stream(gimbal_messages.device_attitude_status, 20, 5, GIMBAL),
}
_GIMBAL_HEARTBEAT = -1
_DEVICE = {_GIMBAL_HEARTBEAT: Stream(gimbal_messages.device_heartbeat, 1, 1, GIMBAL)}


class StreamScheduler:
    """Sends what is due on one link. Intervals are simulated time, so that everything scales with the speed."""

    def __init__(self, link: UdpLink, vehicle: SimulatedVehicle) -> None:
        self._link, self._vehicle = link, vehicle
        self._streams = STREAMS | _DEVICE
        self._period_s: dict[int, float] = {}
        self._heap: list[tuple[float, int]] = []
        for message_id in self._streams:
            self.set_interval(message_id, None)

    def interval(self, message_id: int) -> float | None:
        """Seconds between two, None where it is not streamed."""
        return self._period_s.get(message_id)

    def set_interval(self, message_id: int, seconds: float | None) -> bool:
        """Change how often a message goes out: None for the default, infinity for never. False for an unknown
        message."""
        stream = self._streams.get(message_id)
        if stream is None:
            return False
        if seconds is None:
            rate = stream.onboard_hz if self._link.role == "onboard" else stream.gcs_hz
            seconds = 1.0 / rate if rate else float("inf")
        self._heap = [entry for entry in self._heap if entry[1] != message_id]
        heapq.heapify(self._heap)
        if seconds == float("inf"):
            self._period_s.pop(message_id, None)
        else:
            self._period_s[message_id] = max(seconds, 0.004)
            heapq.heappush(self._heap, (self._vehicle.time_s, message_id))
        return True

    def send_now(self, message_id: int) -> bool:
        """Send one at once; False for a message that there is not (now)."""
        stream = self._streams.get(message_id)
        message = stream.build(self._vehicle) if stream is not None else None
        if stream is None or message is None:
            return False
        self._link.send(message, stream.component)
        return True

    def send_due(self) -> None:
        """Send everything whose time has come."""
        now = self._vehicle.time_s
        heap = self._heap
        while heap and heap[0][0] <= now + 1e-9:
            due, message_id = heap[0]
            period = self._period_s[message_id]
            heapq.heapreplace(heap, (max(due + period, now - period), message_id))
            if self._link.peer is not None:
                self.send_now(message_id)
