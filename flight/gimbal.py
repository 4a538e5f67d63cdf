"""The gimbal: MAVLink's gimbal protocol v2 in and out, and one in process for autopilots that have none."""

from __future__ import annotations

from collections import deque
from math import asin, atan2, cos, isnan, nan, sin

from flight.guidance.angles import difference, wrap

YAW_LOCK = 16
_LOCKED = 4 | 8 | YAW_LOCK  # roll, pitch and yaw held against the world
_YAW_IN_EARTH_FRAME = 64
_YAW_IN_VEHICLE_FRAME = 32


def attitude_message(yaw: float, pitch: float, system: int = 1) -> dict[str, object]:
    """Fields of GIMBAL_MANAGER_SET_ATTITUDE for a yaw from north and a pitch from the horizon, radians.

    PX4's manager takes this message unacknowledged at any rate, as MAVSDK's own streaming mode sends it; each
    DO_GIMBAL_MANAGER_PITCHYAW command would cost an acknowledgement.
    """
    cy, sy, cp, sp = cos(yaw / 2), sin(yaw / 2), cos(pitch / 2), sin(pitch / 2)
    return {
        "target_system": system,
        "target_component": 1,
        "flags": _LOCKED,
        "gimbal_device_id": 0,
        "q": [cy * cp, -sy * sp, cy * sp, sy * cp],
        "angular_velocity_x": None,
        "angular_velocity_y": None,
        "angular_velocity_z": None,
    }


def angles_from(q: tuple[float, float, float, float], flags: int, vehicle_yaw: float) -> tuple[float, float]:
    """Yaw from north and pitch from the horizon, radians, from GIMBAL_DEVICE_ATTITUDE_STATUS.

    Devices older than the two frame flags report yaw from north where YAW_LOCK is set, else from the vehicle's nose.
    """
    w, x, y, z = q
    yaw = atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    pitch = asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    from_north = flags & _YAW_IN_EARTH_FRAME or (flags & YAW_LOCK and not flags & _YAW_IN_VEHICLE_FRAME)
    return (wrap(yaw) if from_north else wrap(yaw + vehicle_yaw)), pitch


class ProcessGimbal:
    """A stabilised gimbal that exists only here: it turns to its angles at a limited rate. Mission seconds, radians."""

    def __init__(self, rate: float = 1.0) -> None:
        self._rate = rate
        self._moves: deque[tuple[float, tuple[float, float], tuple[float, float]]] = deque(maxlen=2000)

    def point(self, now_s: float, yaw: float, pitch: float) -> None:
        """Begin to turn to a yaw from north and a pitch from the horizon. The first call sets them at once."""
        at = self.at(now_s)
        self._moves.append((now_s, (yaw, pitch) if isnan(at[0]) else at, (yaw, pitch)))

    def at(self, stamp_s: float) -> tuple[float, float]:
        """Yaw and pitch at a time; NaN before the first `point`."""
        for since_s, start, end in reversed(tuple(self._moves)):
            if since_s <= stamp_s:
                reach = self._rate * (stamp_s - since_s)
                yaw, pitch = difference(end[0], start[0]), end[1] - start[1]
                return wrap(start[0] + max(-reach, min(reach, yaw))), start[1] + max(-reach, min(reach, pitch))
        return nan, nan
