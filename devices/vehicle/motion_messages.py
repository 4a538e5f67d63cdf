"""What the autopilot streams of its motion: attitude, position, velocity, setpoints, wind, range."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle.body import GRAVITY
from devices.vehicle.vehicle import RANGE_MAX_M, RANGE_MIN_M, SimulatedVehicle

_METRES_PER_DEGREE = math.radians(1.0) * 6_371_000.0
_NO_COVARIANCE = [math.nan] * 21


def milliseconds(vehicle: SimulatedVehicle) -> int:
    """Time since boot as most messages give it."""
    return round(vehicle.time_s * 1e3)


def microseconds(vehicle: SimulatedVehicle) -> int:
    """Time since boot as the others give it."""
    return round(vehicle.time_s * 1e6)


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """(w, x, y, z) of R_z(yaw) R_y(pitch) R_x(roll)."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def global_position(vehicle: SimulatedVehicle, north: float, east: float, down: float) -> tuple[float, float, float]:
    """Latitude and longitude in degrees, altitude above mean sea level in metres, of a place in local NED."""
    s = vehicle.settings
    longitude = s.longitude_deg + east / (_METRES_PER_DEGREE * math.cos(math.radians(s.latitude_deg)))
    return s.latitude_deg + north / _METRES_PER_DEGREE, longitude, s.altitude_m - down


def local_position(vehicle: SimulatedVehicle, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    """North and east in metres of a latitude and longitude; NaN stays NaN."""
    s = vehicle.settings
    east = (longitude_deg - s.longitude_deg) * _METRES_PER_DEGREE * math.cos(math.radians(s.latitude_deg))
    return (latitude_deg - s.latitude_deg) * _METRES_PER_DEGREE, east


def attitude(v: SimulatedVehicle) -> Any:
    e = v.estimate
    return mavlink.MAVLink_attitude_message(
        milliseconds(v), e.roll, e.pitch, e.yaw, e.roll_rate, e.pitch_rate, e.yaw_rate
    )


def attitude_quaternion(v: SimulatedVehicle) -> Any:
    e = v.estimate
    rates = (e.roll_rate, e.pitch_rate, e.yaw_rate)
    return mavlink.MAVLink_attitude_quaternion_message(milliseconds(v), *quaternion(e.roll, e.pitch, e.yaw), *rates)


def highres_imu(v: SimulatedVehicle) -> Any:
    body, e = v.body, v.estimate
    field = (0.21 * math.cos(e.yaw), -0.21 * math.sin(e.yaw), 0.43)
    force = (0.0, 0.0, -GRAVITY if body.on_ground else -body.thrust)
    rates = (e.roll_rate, e.pitch_rate, e.yaw_rate)
    pressure = 1013.25 - 0.12 * (v.settings.altitude_m - e.d)
    return mavlink.MAVLink_highres_imu_message(
        microseconds(v), *force, *rates, *field, pressure, 0.0, v.settings.altitude_m - e.d, 25.0, 0x1FFF
    )


def global_position_int(v: SimulatedVehicle) -> Any:
    e = v.estimate
    latitude, longitude, altitude = global_position(v, e.n, e.e, e.d)
    height = v.firmware.flight.home[2] - e.d
    return mavlink.MAVLink_global_position_int_message(
        milliseconds(v),
        round(latitude * 1e7),
        round(longitude * 1e7),
        round(altitude * 1e3),
        round(height * 1e3),
        round(e.vn * 100),
        round(e.ve * 100),
        round(e.vd * 100),
        round(math.degrees(e.yaw) % 360 * 100) % 36000,
    )


def local_position_ned(v: SimulatedVehicle) -> Any:
    e = v.estimate
    return mavlink.MAVLink_local_position_ned_message(milliseconds(v), e.n, e.e, e.d, e.vn, e.ve, e.vd)


def odometry(v: SimulatedVehicle) -> Any:
    e = v.estimate
    cy, sy = math.cos(e.yaw), math.sin(e.yaw)
    pose = list(_NO_COVARIANCE)
    pose[0] = pose[6] = e.sigma_m**2
    pose[11] = (2 * e.sigma_m) ** 2
    return mavlink.MAVLink_odometry_message(
        microseconds(v),
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_BODY_FRD,
        *(e.n, e.e, e.d),
        list(quaternion(e.roll, e.pitch, e.yaw)),
        *(e.vn * cy + e.ve * sy, e.ve * cy - e.vn * sy, e.vd),
        *(e.roll_rate, e.pitch_rate, e.yaw_rate),
        pose,
        _NO_COVARIANCE,
        e.resets % 256,
        mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
        100,
    )


def altitude(v: SimulatedVehicle) -> Any:
    e, height = v.estimate, v.firmware.flight.home[2] - v.estimate.d
    amsl = v.settings.altitude_m - e.d
    return mavlink.MAVLink_altitude_message(microseconds(v), amsl, amsl, -e.d, height, math.nan, math.nan)


def vfr_hud(v: SimulatedVehicle) -> Any:
    e = v.estimate
    speed = math.hypot(e.vn, e.ve)
    heading = round(math.degrees(e.yaw) % 360) % 360
    throttle = round(min(v.body.thrust / (2 * GRAVITY), 1.0) * 100)
    return mavlink.MAVLink_vfr_hud_message(speed, speed, heading, throttle, v.settings.altitude_m - e.d, -e.vd)


def gps_raw_int(v: SimulatedVehicle) -> Any:
    e = v.estimate
    latitude, longitude, height = global_position(v, e.n, e.e, e.d)
    speed, course = math.hypot(e.vn, e.ve), math.degrees(math.atan2(e.ve, e.vn)) % 360
    place = (round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3))
    fix = mavlink.GPS_FIX_TYPE_3D_FIX if v.time_s > 1.0 else mavlink.GPS_FIX_TYPE_NO_FIX
    return mavlink.MAVLink_gps_raw_int_message(
        microseconds(v), fix, *place, 90, 120, round(speed * 100), round(course * 100) % 36000, 14, place[2], 900, 1500
    )


def distance_sensor(v: SimulatedVehicle) -> Any:
    """Beyond its reach it says one centimetre more than its longest distance, with a signal quality of 1 (invalid)."""
    most = round(RANGE_MAX_M * 100)
    seen = v.range_m is not None
    distance = round(v.range_m * 100) if v.range_m is not None else most + 1
    return mavlink.MAVLink_distance_sensor_message(
        *(milliseconds(v), round(RANGE_MIN_M * 100), most, distance),
        *(mavlink.MAV_DISTANCE_SENSOR_LASER, 0, mavlink.MAV_SENSOR_ROTATION_NONE, 0),
        signal_quality=100 if seen else 1,
    )


def wind_cov(v: SimulatedVehicle) -> Any:
    north, east = v.wind_estimate
    return mavlink.MAVLink_wind_cov_message(
        microseconds(v), north, east, 0.0, 0.25, 0.25, v.settings.altitude_m - v.estimate.d, 0.5, math.nan
    )


def attitude_target(v: SimulatedVehicle) -> Any:
    body = v.body
    yaw = v.controller.yaw_target if math.isfinite(v.controller.yaw_target) else v.estimate.yaw
    attitude = list(quaternion(body.roll_command, body.pitch_command, yaw))
    thrust = min(body.thrust_command / (2 * GRAVITY), 1.0)
    return mavlink.MAVLink_attitude_target_message(milliseconds(v), 0, attitude, 0.0, 0.0, 0.0, thrust)


def position_target_local_ned(v: SimulatedVehicle) -> Any:
    t = v.firmware.target
    nowhere = (math.nan,) * 3
    return mavlink.MAVLink_position_target_local_ned_message(
        *(milliseconds(v), mavlink.MAV_FRAME_LOCAL_NED, 0),
        *(t.n, t.e, t.d),
        *(t.vn, t.ve, t.vd),
        *nowhere,
        *(t.yaw, t.yaw_rate),
    )


def servo_output_raw(v: SimulatedVehicle) -> Any:
    pulse = 900 if not v.firmware.armed else round(1000 + 1000 * min(v.body.thrust / (2 * GRAVITY), 1.0))
    return mavlink.MAVLink_servo_output_raw_message(microseconds(v) & 0xFFFFFFFF, 0, *(pulse,) * 4, *(0,) * 4)
