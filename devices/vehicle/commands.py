"""MAVLink commands (COMMAND_LONG, COMMAND_INT, SET_MODE) turned into calls of the firmware, with PX4's answers."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle import gimbal_messages, status_messages
from devices.vehicle.modes import Mode
from devices.vehicle.motion_messages import local_position
from devices.vehicle.results import Result
from devices.vehicle.streams import StreamScheduler
from devices.vehicle.udp_link import AUTOPILOT, GIMBAL, UdpLink
from devices.vehicle.vehicle import SimulatedVehicle

_FORCE = 21196.0
_UNCHANGED, _MYSELF = -1, -2
_EARTH_YAW = mavlink.GIMBAL_MANAGER_FLAGS_YAW_LOCK | mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME


@dataclass(frozen=True)
class Command:
    """A command as received: seven numbers (latitude and longitude in degrees), and whom it came from and was meant
    for.

    above_home: the height in the seventh is above home, else above mean sea level.
    """

    number: int
    p: tuple[float, float, float, float, float, float, float]
    sender: tuple[int, int]
    component: int
    above_home: bool = False


def command_of(message: Any) -> Command:
    """The command in a COMMAND_LONG or COMMAND_INT."""
    sender = (message.get_srcSystem(), message.get_srcComponent())
    four = (message.param1, message.param2, message.param3, message.param4)
    if message.get_type() == "COMMAND_LONG":
        place = (message.param5, message.param6, message.param7)
        return Command(message.command, (*four, *place), sender, message.target_component)
    unknown = 0x7FFFFFFF
    latitude, longitude = (math.nan if n == unknown else n / 1e7 for n in (message.x, message.y))
    above_home = message.frame in (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
    numbers = (*four, latitude, longitude, message.z)
    return Command(message.command, numbers, sender, message.target_component, above_home)


class CommandHandler:
    """Answers the commands of one link. Every command gets its COMMAND_ACK; DO_SET_MODE gets two, as from PX4."""

    def __init__(self, link: UdpLink, vehicle: SimulatedVehicle, streams: StreamScheduler) -> None:
        self._link, self._vehicle, self._streams = link, vehicle, streams
        self._handlers: dict[int, Callable[[Command], Result]] = {
            mavlink.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_disarm,
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_NAV_TAKEOFF: self._take_off,
            mavlink.MAV_CMD_NAV_LAND: lambda command: self._vehicle.set_mode("LAND"),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda command: self._vehicle.set_mode("RTL"),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: lambda command: self._vehicle.set_mode("HOLD"),
            mavlink.MAV_CMD_MISSION_START: lambda command: self._vehicle.set_mode("MISSION"),
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_DO_FLIGHTTERMINATION: self._terminate,
            mavlink.MAV_CMD_RUN_PREARM_CHECKS: lambda command: Result.ACCEPTED,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._capabilities,
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: self._take_gimbal,
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: self._point_gimbal,
        }

    def handle(self, message: Any) -> None:
        """Carry out a COMMAND_LONG or COMMAND_INT that is meant for this vehicle, and acknowledge it."""
        command = command_of(message)
        if message.target_system not in (0, AUTOPILOT) or command.component not in (0, AUTOPILOT, GIMBAL):
            return
        handler = self._handlers.get(command.number)
        if command.number == mavlink.MAV_CMD_DO_SET_MODE:
            self._acknowledge(command, Result.ACCEPTED)
        try:
            result = handler(command) if handler is not None else Result.UNSUPPORTED
        except (ValueError, OverflowError, struct.error):
            result = Result.DENIED  # not a number where a whole one is needed
        self._acknowledge(command, result)

    def set_mode_message(self, message: Any) -> None:
        """The old SET_MODE message: no answer but the mode itself."""
        if message.target_system in (0, AUTOPILOT):
            mode = Mode.of(message.custom_mode >> 16 & 0xFF, message.custom_mode >> 24 & 0xFF)
            if mode is not None:
                self._vehicle.firmware.set_mode(mode)

    def steer_gimbal(self, sender: tuple[int, int], flags: int, pitch: float, yaw: float) -> Result:
        """New gimbal angles in radians from a component, DENIED while that is not in control."""
        gimbal = self._vehicle.gimbal
        if gimbal.primary != sender:
            return Result.DENIED
        gimbal.point(pitch, yaw, yaw_lock=bool(flags & _EARTH_YAW))
        return Result.ACCEPTED

    def _acknowledge(self, command: Command, result: Result) -> None:
        component = GIMBAL if command.component == GIMBAL else AUTOPILOT
        answer = mavlink.MAVLink_command_ack_message(command.number, result, 0, 0, *command.sender)
        self._link.send(answer, component)

    def _arm_disarm(self, command: Command) -> Result:
        force = command.p[1] == _FORCE
        firmware = self._vehicle.firmware
        return firmware.arm(force) if command.p[0] > 0.5 else firmware.disarm(force)

    def _set_mode(self, command: Command) -> Result:
        if not int(command.p[0]) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return Result.UNSUPPORTED
        mode = Mode.of(int(command.p[1]), int(command.p[2]))
        return Result.UNSUPPORTED if mode is None else self._vehicle.firmware.set_mode(mode)

    def _take_off(self, command: Command) -> Result:
        down = self._down(command)
        return self._vehicle.firmware.take_off(down if math.isfinite(down) else None)

    def _reposition(self, command: Command) -> Result:
        north, east = local_position(self._vehicle, command.p[4], command.p[5])
        return self._vehicle.firmware.reposition(north, east, self._down(command), command.p[3])

    def _down(self, command: Command) -> float:
        home = self._vehicle.firmware.flight.home[2]
        return (home if command.above_home else self._vehicle.settings.altitude_m) - command.p[6]

    def _terminate(self, command: Command) -> Result:
        return self._vehicle.firmware.disarm(force=True) if command.p[0] > 0.5 else Result.ACCEPTED

    def _change_speed(self, command: Command) -> Result:
        if command.p[1] > 0:
            self._vehicle.firmware.parameters.set("MPC_XY_CRUISE", command.p[1])
        return Result.ACCEPTED

    def _request_message(self, command: Command) -> Result:
        message_id = int(command.p[0])
        if message_id == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES:
            wanted = int(command.p[1])
            for index in range(1, len(Mode) + 1) if wanted == 0 else (wanted,):
                self._link.send(status_messages.available_modes(self._vehicle, index))
            return Result.ACCEPTED
        return Result.ACCEPTED if self._streams.send_now(message_id) else Result.DENIED

    def _set_interval(self, command: Command) -> Result:
        microseconds = command.p[1]
        seconds = None if microseconds == 0 else (math.inf if microseconds < 0 else microseconds / 1e6)
        return Result.ACCEPTED if self._streams.set_interval(int(command.p[0]), seconds) else Result.DENIED

    def _get_interval(self, command: Command) -> Result:
        seconds = self._streams.interval(int(command.p[0]))
        interval = -1 if seconds is None else round(seconds * 1e6)
        self._link.send(mavlink.MAVLink_message_interval_message(int(command.p[0]), interval))
        return Result.ACCEPTED

    def _capabilities(self, command: Command) -> Result:
        self._link.send(status_messages.autopilot_version(self._vehicle))
        return Result.ACCEPTED

    def _take_gimbal(self, command: Command) -> Result:
        if not gimbal_messages.speaks(self._vehicle):
            return Result.UNSUPPORTED
        gimbal, (system, component) = self._vehicle.gimbal, (int(command.p[0]), int(command.p[1]))
        if system == _MYSELF:
            gimbal.take(*command.sender)
        elif system > 0:
            gimbal.take(system, component)
        elif system != _UNCHANGED and gimbal.primary == command.sender:
            gimbal.release()
        self._streams.send_now(mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS)
        return Result.ACCEPTED

    def _point_gimbal(self, command: Command) -> Result:
        if not gimbal_messages.speaks(self._vehicle):
            return Result.UNSUPPORTED
        pitch, yaw = math.radians(command.p[0]), math.radians(command.p[1])
        flags = int(command.p[4]) if math.isfinite(command.p[4]) else 0
        return self.steer_gimbal(command.sender, flags, pitch, yaw)
