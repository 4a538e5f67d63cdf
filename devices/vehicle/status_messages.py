"""What the autopilot streams of its condition: heartbeat, health, battery, landed state, mode, home, identity."""

from __future__ import annotations

import math
import time
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle.battery import CELLS
from devices.vehicle.estimator import VALID_AFTER_S
from devices.vehicle.modes import Mode
from devices.vehicle.motion_messages import global_position, microseconds, milliseconds
from devices.vehicle.vehicle import SimulatedVehicle

_ESTIMATOR_GOOD = 0x01 | 0x02 | 0x04 | 0x08 | 0x10 | 0x20 | 0x100 | 0x200
_PX4_VERSION = 1 << 24 | 17 << 16 | 0 << 8 | 255
_SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | mavlink.MAV_SYS_STATUS_SENSOR_GPS
    | mavlink.MAV_SYS_STATUS_AHRS
    | mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
    | mavlink.MAV_SYS_STATUS_GEOFENCE
    | mavlink.MAV_SYS_STATUS_PREARM_CHECK
)
_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)
_STANDARD_MODES = {
    Mode.POSCTL: mavlink.MAV_STANDARD_MODE_POSITION_HOLD,
    Mode.ALTCTL: mavlink.MAV_STANDARD_MODE_ALTITUDE_HOLD,
    Mode.RTL: mavlink.MAV_STANDARD_MODE_SAFE_RECOVERY,
    Mode.LAND: mavlink.MAV_STANDARD_MODE_LAND,
    Mode.TAKEOFF: mavlink.MAV_STANDARD_MODE_TAKEOFF,
    Mode.MISSION: mavlink.MAV_STANDARD_MODE_MISSION,
}
_MODE_NAMES = {Mode.HOLD: "Hold", Mode.TAKEOFF: "Takeoff", Mode.LAND: "Land", Mode.RTL: "Return"}


def heartbeat(v: SimulatedVehicle) -> Any:
    f = v.firmware
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if f.armed else 0)
    base |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED if f.mode.piloted else mavlink.MAV_MODE_FLAG_AUTO_ENABLED
    base |= mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
    state = mavlink.MAV_STATE_ACTIVE if f.armed else mavlink.MAV_STATE_STANDBY
    if f.armed and f.failsafe is not None:
        state = mavlink.MAV_STATE_CRITICAL
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, base, f.mode.custom, state, 3
    )


def sys_status(v: SimulatedVehicle) -> Any:
    healthy = _SENSORS
    if v.time_s < VALID_AFTER_S:
        healthy &= ~(mavlink.MAV_SYS_STATUS_SENSOR_GPS | mavlink.MAV_SYS_STATUS_AHRS)
    if v.firmware.not_armable is not None:
        healthy &= ~mavlink.MAV_SYS_STATUS_PREARM_CHECK
    battery = v.battery
    volts, amperes = round(battery.voltage_v * 1e3), round(battery.current_a * 100)
    return mavlink.MAVLink_sys_status_message(
        _SENSORS, _SENSORS, healthy, 200, volts, amperes, math.ceil(battery.percent), *(0,) * 6
    )


def battery_status(v: SimulatedVehicle) -> Any:
    battery = v.battery
    cells = [round(battery.cell_v * 1e3)] * CELLS + [0xFFFF] * (10 - CELLS)
    charge = mavlink.MAV_BATTERY_CHARGE_STATE_OK
    for parameter, state in (
        ("BAT_LOW_THR", mavlink.MAV_BATTERY_CHARGE_STATE_LOW),
        ("BAT_CRIT_THR", mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL),
        ("BAT_EMERGEN_THR", mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY),
    ):
        charge = state if battery.percent < 100 * float(v.firmware.parameters[parameter]) else charge
    return mavlink.MAVLink_battery_status_message(
        *(0, mavlink.MAV_BATTERY_FUNCTION_ALL, mavlink.MAV_BATTERY_TYPE_LIPO, 2500, cells),
        *(round(battery.current_a * 100), round(battery.consumed_mah), -1, math.ceil(battery.percent)),
        *(round(battery.remaining_s), charge),
    )


def extended_sys_state(v: SimulatedVehicle) -> Any:
    f = v.firmware
    landed = mavlink.MAV_LANDED_STATE_IN_AIR
    if f.landed:
        landed = mavlink.MAV_LANDED_STATE_ON_GROUND
    elif f.land_detector.taking_off:
        landed = mavlink.MAV_LANDED_STATE_TAKEOFF
    elif f.mode is Mode.LAND:
        landed = mavlink.MAV_LANDED_STATE_LANDING
    return mavlink.MAVLink_extended_sys_state_message(mavlink.MAV_VTOL_STATE_UNDEFINED, landed)


def current_mode(v: SimulatedVehicle) -> Any:
    f = v.firmware
    return mavlink.MAVLink_current_mode_message(_STANDARD_MODES.get(f.mode, 0), f.mode.custom, f.intended.custom)


def available_modes(v: SimulatedVehicle, index: int) -> Any:
    """One entry (from 1) of the list of modes; the first for an index out of range."""
    modes = list(Mode)
    mode = modes[index - 1 if 1 <= index <= len(modes) else 0]
    name = _MODE_NAMES.get(mode, mode.name.capitalize())
    return mavlink.MAVLink_available_modes_message(
        len(modes), modes.index(mode) + 1, _STANDARD_MODES.get(mode, 0), mode.custom, 0, name.encode()
    )


def home_position(v: SimulatedVehicle) -> Any | None:
    if v.time_s < VALID_AFTER_S:
        return None
    north, east, down = v.firmware.flight.home
    latitude, longitude, altitude = global_position(v, north, east, down)
    return mavlink.MAVLink_home_position_message(
        *(round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3), north, east, down),
        *([1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0),
        microseconds(v),
    )


def gps_global_origin(v: SimulatedVehicle) -> Any | None:
    if v.time_s < VALID_AFTER_S:
        return None
    s = v.settings
    place = (round(s.latitude_deg * 1e7), round(s.longitude_deg * 1e7), round(s.altitude_m * 1e3))
    return mavlink.MAVLink_gps_global_origin_message(*place, microseconds(v))


def estimator_status(v: SimulatedVehicle) -> Any:
    flags = _ESTIMATOR_GOOD if v.time_s >= VALID_AFTER_S else 0
    ratios = (0.05,) * 4
    sigma = v.estimate.sigma_m
    return mavlink.MAVLink_estimator_status_message(microseconds(v), flags, *ratios, 0.0, 0.0, sigma, 1.5 * sigma)


def autopilot_version(v: SimulatedVehicle) -> Any:
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        _CAPABILITIES, _PX4_VERSION, 0, 0, 0, nothing, nothing, nothing, 0, 0, 0x424C41444553494D
    )


def scaled_pressure(v: SimulatedVehicle) -> Any:
    pressure = 1013.25 - 0.12 * (v.settings.altitude_m - v.estimate.d)
    return mavlink.MAVLink_scaled_pressure_message(milliseconds(v), pressure, 0.0, 2500)


def system_time(v: SimulatedVehicle) -> Any:
    return mavlink.MAVLink_system_time_message(round(time.time() * 1e6), milliseconds(v))


def mission_current(v: SimulatedVehicle) -> Any:
    return mavlink.MAVLink_mission_current_message(0, 0, mavlink.MISSION_STATE_NO_MISSION)


def vibration(v: SimulatedVehicle) -> Any:
    level = 0.02 if v.firmware.landed else 0.3
    return mavlink.MAVLink_vibration_message(microseconds(v), level, level, level, 0, 0, 0)


def ping(v: SimulatedVehicle) -> Any:
    return mavlink.MAVLink_ping_message(microseconds(v), milliseconds(v) // 1000, 0, 0)


def timesync(v: SimulatedVehicle) -> Any:
    return mavlink.MAVLink_timesync_message(0, round(v.time_s * 1e9))
