"""What gimbal manager (the autopilot) and gimbal device stream, in MAVLink's gimbal protocol v2."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle.body import wrap
from devices.vehicle.gimbal import PITCH_RANGE, YAW_RANGE
from devices.vehicle.motion_messages import milliseconds, quaternion
from devices.vehicle.udp_link import GIMBAL
from devices.vehicle.vehicle import SimulatedVehicle

_MNT_MAVLINK_V2 = 4
_CAPABILITIES = (
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_NEUTRAL
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_AXIS
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_LOCK
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_FOLLOW
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_LOCK
)
_LIMITS = (0.0, 0.0, *PITCH_RANGE, *YAW_RANGE)
_LEVEL = mavlink.GIMBAL_DEVICE_FLAGS_ROLL_LOCK | mavlink.GIMBAL_DEVICE_FLAGS_PITCH_LOCK
_LOCKED = _LEVEL | mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME
_FOLLOWING = _LEVEL | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME


def speaks(v: SimulatedVehicle) -> bool:
    """Whether the gimbal protocol is on at all: MNT_MODE_IN must be 4."""
    return v.firmware.parameters["MNT_MODE_IN"] == _MNT_MAVLINK_V2


def manager_information(v: SimulatedVehicle) -> Any | None:
    if not speaks(v):
        return None
    return mavlink.MAVLink_gimbal_manager_information_message(milliseconds(v), _CAPABILITIES, GIMBAL, *_LIMITS)


def manager_status(v: SimulatedVehicle) -> Any | None:
    if not speaks(v):
        return None
    flags = _LOCKED if v.gimbal.yaw_lock else _FOLLOWING
    return mavlink.MAVLink_gimbal_manager_status_message(
        milliseconds(v), flags, GIMBAL, *(v.gimbal.primary or (0, 0)), 0, 0
    )


def device_heartbeat(v: SimulatedVehicle) -> Any | None:
    if not speaks(v):
        return None
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )


def device_information(v: SimulatedVehicle) -> Any | None:
    if not speaks(v):
        return None
    return mavlink.MAVLink_gimbal_device_information_message(
        *(milliseconds(v), b"blade-mission", b"simulated", b"", 1, 1, 0, _CAPABILITIES, 0, *_LIMITS, 0)
    )


def device_attitude_status(v: SimulatedVehicle) -> Any | None:
    """Yaw from north where it is locked to the world, from the nose where it follows."""
    if not speaks(v):
        return None
    gimbal, nose = v.gimbal, v.estimate.yaw
    yaw, pitch = gimbal.reading
    attitude = list(quaternion(0.0, pitch, yaw if gimbal.yaw_lock else wrap(yaw - nose)))
    flags = _LOCKED if gimbal.yaw_lock else _FOLLOWING
    return mavlink.MAVLink_gimbal_device_attitude_status_message(
        *(0, 0, milliseconds(v), flags, attitude, 0.0, gimbal.pitch_rate, gimbal.yaw_rate, 0),
        *(nose, math.nan, 0),
    )
