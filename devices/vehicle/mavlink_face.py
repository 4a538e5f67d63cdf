"""The vehicle as seen over one MAVLink link: streams out, and what each incoming message does."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle.commands import CommandHandler
from devices.vehicle.control import NAN, Target
from devices.vehicle.modes import Sticks
from devices.vehicle.parameter_protocol import ParameterProtocol
from devices.vehicle.streams import StreamScheduler
from devices.vehicle.udp_link import AUTOPILOT, UdpLink
from devices.vehicle.vehicle import SimulatedVehicle

_IGNORE_YAW, _IGNORE_YAW_RATE = 1 << 10, 1 << 11
_BODY_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD)


class MavlinkFace:
    """One link's side of the conversation. `on_setpoint` is called for every offboard setpoint that arrives."""

    def __init__(self, link: UdpLink, vehicle: SimulatedVehicle, on_setpoint: Callable[[], None]) -> None:
        self.link, self._vehicle, self._on_setpoint = link, vehicle, on_setpoint
        self.streams = StreamScheduler(link, vehicle)
        self._commands = CommandHandler(link, vehicle, self.streams)
        self._parameters = ParameterProtocol(link, vehicle.firmware.parameters)
        self._texts_seen = 0
        self._handlers: dict[str, Callable[[Any], None]] = {
            "HEARTBEAT": self._heartbeat,
            "COMMAND_LONG": self._commands.handle,
            "COMMAND_INT": self._commands.handle,
            "SET_MODE": self._commands.set_mode_message,
            "PARAM_REQUEST_LIST": self._parameters.handle,
            "PARAM_REQUEST_READ": self._parameters.handle,
            "PARAM_SET": self._parameters.handle,
            "SET_POSITION_TARGET_LOCAL_NED": self._setpoint,
            "TIMESYNC": self._timesync,
            "PING": self._ping,
            "MISSION_REQUEST_LIST": self._mission_list,
            "MISSION_COUNT": self._mission_upload,
            "MISSION_CLEAR_ALL": self._mission_clear,
            "MANUAL_CONTROL": self._manual_control,
            "RC_CHANNELS_OVERRIDE": self._rc_override,
            "GIMBAL_MANAGER_SET_ATTITUDE": self._gimbal_attitude,
            "GIMBAL_MANAGER_SET_PITCHYAW": self._gimbal_pitchyaw,
        }

    def receive(self) -> None:
        """Deal with everything that has arrived."""
        for message in self.link.receive():
            handler = self._handlers.get(message.get_type())
            if handler is not None:
                handler(message)

    def send_due(self) -> None:
        """Send what is due: streams, texts for a ground station, the rest of a parameter list."""
        self.streams.send_due()
        self._parameters.send_waiting()
        texts = self._vehicle.texts
        while self._texts_seen < len(texts):
            severity, text = texts[self._texts_seen]
            self._texts_seen += 1
            if self.link.hears_gcs:
                self.link.send(mavlink.MAVLink_statustext_message(severity, text.encode()[:50]))

    def _heartbeat(self, message: Any) -> None:
        if message.type == mavlink.MAV_TYPE_GCS:
            self._vehicle.firmware.failsafes.gcs_heartbeat()

    def _setpoint(self, message: Any) -> None:
        if message.target_system not in (0, AUTOPILOT):
            return
        mask = message.type_mask
        place = [NAN if mask & 1 << axis else value for axis, value in enumerate((message.x, message.y, message.z))]
        speed = [0.0 if mask & 8 << axis else value for axis, value in enumerate((message.vx, message.vy, message.vz))]
        if message.coordinate_frame in _BODY_FRAMES:
            yaw = self._vehicle.estimate.yaw
            cy, sy = math.cos(yaw), math.sin(yaw)
            speed[:2] = speed[0] * cy - speed[1] * sy, speed[0] * sy + speed[1] * cy
            place = [NAN, NAN, NAN]
        elif message.coordinate_frame != mavlink.MAV_FRAME_LOCAL_NED:
            return
        heading = NAN if mask & _IGNORE_YAW else message.yaw
        turn = 0.0 if mask & _IGNORE_YAW_RATE else message.yaw_rate
        target = Target(place[0], place[1], place[2], speed[0], speed[1], speed[2], heading, turn)
        self._vehicle.firmware.offboard_setpoint(target)
        self._on_setpoint()

    def _timesync(self, message: Any) -> None:
        if message.tc1 == 0:
            now = round(self._vehicle.time_s * 1e9)
            self.link.send(mavlink.MAVLink_timesync_message(now, message.ts1))

    def _ping(self, message: Any) -> None:
        if message.target_system == 0:
            sender = (message.get_srcSystem(), message.get_srcComponent())
            self.link.send(mavlink.MAVLink_ping_message(message.time_usec, message.seq, *sender))

    def _mission_list(self, message: Any) -> None:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        self.link.send(mavlink.MAVLink_mission_count_message(*sender, 0, message.mission_type))

    def _mission_upload(self, message: Any) -> None:
        result = mavlink.MAV_MISSION_ACCEPTED if message.count == 0 else mavlink.MAV_MISSION_UNSUPPORTED
        self._mission_answer(message, result)

    def _mission_clear(self, message: Any) -> None:
        self._mission_answer(message, mavlink.MAV_MISSION_ACCEPTED)

    def _mission_answer(self, message: Any, result: int) -> None:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        self.link.send(mavlink.MAVLink_mission_ack_message(*sender, result, message.mission_type))

    def _manual_control(self, message: Any) -> None:
        if message.target == AUTOPILOT:
            throttle = (message.z - 500) / 500
            self._vehicle.firmware.pilot(Sticks(message.x / 1000, message.y / 1000, throttle, message.r / 1000))

    def _rc_override(self, message: Any) -> None:
        channels = (message.chan1_raw, message.chan2_raw, message.chan3_raw, message.chan4_raw)
        if message.target_system == AUTOPILOT and all(800 < value < 2200 for value in channels):
            roll, pitch, throttle, yaw = ((value - 1500) / 500 for value in channels)
            self._vehicle.firmware.pilot(Sticks(-pitch, roll, throttle, yaw))

    def _gimbal_attitude(self, message: Any) -> None:
        w, x, y, z = message.q
        if not all(math.isfinite(value) for value in message.q):
            return
        pitch = math.asin(min(max(2 * (w * y - z * x), -1.0), 1.0))
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        sender = (message.get_srcSystem(), message.get_srcComponent())
        self._commands.steer_gimbal(sender, message.flags, pitch, yaw)

    def _gimbal_pitchyaw(self, message: Any) -> None:
        sender = (message.get_srcSystem(), message.get_srcComponent())
        self._commands.steer_gimbal(sender, message.flags, message.pitch, message.yaw)
