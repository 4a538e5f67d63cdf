"""The true motion of a quadrotor: attitude that follows with limits and lag, thrust, drag in the wind, the ground."""

from __future__ import annotations

import math

from devices.vehicle.settings import Airframe

GRAVITY = 9.80665
STEP_S = 0.004

_ATTITUDE_1_S = 7.0
_YAW_1_S = 2.8
_RATE_LAG_S = 0.045
_THRUST_LAG_S = 0.04


class Body:
    """True state, plain floats in SI units, local NED with its origin on the ground; the attitude in radians.

    The commands are what the controller last asked for: `roll_command`, `pitch_command`, `yaw_command` (true attitude
    that it is to reach) and `thrust_command`, the specific force along the rotors' axis in m/s².
    """

    def __init__(self, airframe: Airframe, yaw: float) -> None:
        self.n = self.e = self.d = 0.0
        self.vn = self.ve = self.vd = 0.0
        self.an = self.ae = self.ad = 0.0
        self.roll = self.pitch = 0.0
        self.yaw = yaw
        self.roll_rate = self.pitch_rate = self.yaw_rate = 0.0
        self.thrust = 0.0
        self.on_ground = True
        self.impact_m_s = 0.0
        self.roll_command = self.pitch_command = 0.0
        self.yaw_command = yaw
        self.thrust_command = 0.0
        self._rate_max = math.radians(airframe.rate_max_deg_s)
        self._yaw_rate_max = math.radians(airframe.yaw_rate_max_deg_s)
        self._drag = (airframe.drag_1_s, airframe.drag_1_m)

    def step(self, wind: tuple[float, float, float]) -> None:
        """Four milliseconds of motion in a wind (north, east, down) m/s."""
        dt = STEP_S
        self.thrust += (self.thrust_command - self.thrust) * (dt / _THRUST_LAG_S)
        if self.on_ground and self.thrust < GRAVITY:
            self.roll_rate = self.pitch_rate = self.yaw_rate = 0.0
            self.roll *= 0.97
            self.pitch *= 0.97
            self.an = self.ae = self.ad = 0.0
            return
        self._turn(dt)
        cr, sr, cp, sp = math.cos(self.roll), math.sin(self.roll), math.cos(self.pitch), math.sin(self.pitch)
        cy, sy = math.cos(self.yaw), math.sin(self.yaw)
        rn, re, rd = self.vn - wind[0], self.ve - wind[1], self.vd - wind[2]
        drag = self._drag[0] + self._drag[1] * math.sqrt(rn * rn + re * re + rd * rd)
        thrust = self.thrust
        self.an = -thrust * (cy * sp * cr + sy * sr) - drag * rn
        self.ae = -thrust * (sy * sp * cr - cy * sr) - drag * re
        self.ad = -thrust * cp * cr + GRAVITY - drag * rd
        self.vn += self.an * dt
        self.ve += self.ae * dt
        self.vd += self.ad * dt
        self.n += self.vn * dt
        self.e += self.ve * dt
        self.d += self.vd * dt
        if self.d >= 0.0:
            if self.vd > 0.05:
                self.impact_m_s = self.vd
            if self.vd > 0.0:
                self.vn = self.ve = self.vd = 0.0
            self.d = 0.0
            self.on_ground = True
        else:
            self.on_ground = False

    def _turn(self, dt: float) -> None:
        limit = self._rate_max
        gain = dt / _RATE_LAG_S
        wanted = _ATTITUDE_1_S * (self.roll_command - self.roll)
        self.roll_rate += (min(max(wanted, -limit), limit) - self.roll_rate) * gain
        wanted = _ATTITUDE_1_S * (self.pitch_command - self.pitch)
        self.pitch_rate += (min(max(wanted, -limit), limit) - self.pitch_rate) * gain
        limit = self._yaw_rate_max
        wanted = _YAW_1_S * wrap(self.yaw_command - self.yaw)
        self.yaw_rate += (min(max(wanted, -limit), limit) - self.yaw_rate) * gain
        self.roll += self.roll_rate * dt
        self.pitch += self.pitch_rate * dt
        self.yaw = wrap(self.yaw + self.yaw_rate * dt)


def wrap(angle: float) -> float:
    """The angle in [-π, π)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi
