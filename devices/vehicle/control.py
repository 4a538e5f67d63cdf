"""The autopilot's cascade: position to velocity to acceleration to attitude and thrust, with PX4's limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from devices.vehicle.body import GRAVITY, Body
from devices.vehicle.estimator import Estimator
from devices.vehicle.settings import Airframe

NAN = math.nan


@dataclass
class Target:
    """What a flight mode asks for, local NED in SI units. NaN in a position axis leaves that axis to the velocity,
    which otherwise is fed forward. NaN yaw keeps the heading; the rates are limits."""

    n: float = NAN
    e: float = NAN
    d: float = NAN
    vn: float = 0.0
    ve: float = 0.0
    vd: float = 0.0
    yaw: float = NAN
    yaw_rate: float = 0.0
    speed_max: float = 12.0
    climb_max: float = 3.0
    sink_max: float = 1.5

    def ask_only_for_numbers(self) -> None:
        """Leave open where and which way it is to be, and ask for no speed, where the numbers for it are not finite."""
        place, speed = (self.n, self.e, self.d, self.yaw), (self.vn, self.ve, self.vd, self.yaw_rate)
        self.n, self.e, self.d, self.yaw = (value if math.isfinite(value) else NAN for value in place)
        self.vn, self.ve, self.vd, self.yaw_rate = (value if math.isfinite(value) else 0.0 for value in speed)


POSITION_1_S = 0.73
BRAKE_M_S2 = 2.6
SLEW_M_S2 = 3.2
VELOCITY_1_S = 2.2
INTEGRAL_1_S2 = 0.6
HEIGHT_1_S = 1.0
HEIGHT_BRAKE_M_S2 = 1.2
HEIGHT_SLEW_M_S2 = 2.0
CLIMB_1_S = 4.0
CLIMB_INTEGRAL_1_S2 = 2.0
_INTEGRAL_MAX_M_S2 = 6.0


class Controller:
    """Turns a target into the body's commands; flies on the estimate."""

    def __init__(self, airframe: Airframe) -> None:
        self._tilt_max = math.radians(airframe.tilt_max_deg)
        self._integral = [0.0, 0.0, 0.0]
        self._velocity = [0.0, 0.0, 0.0]
        self._yaw = NAN
        self.yaw_target = NAN

    def reset(self, estimate: Estimator) -> None:
        """Start afresh, as at arming."""
        self._integral = [0.0, 0.0, 0.0]
        self._velocity = [0.0, 0.0, 0.0]
        self._yaw = estimate.yaw

    def update(self, target: Target, estimate: Estimator, body: Body, seconds: float) -> None:
        """One control cycle of so many seconds."""
        north, east, down = self._velocity_setpoint(target, estimate, seconds)
        error_n, error_e, error_d = north - estimate.vn, east - estimate.ve, down - estimate.vd
        limit = _INTEGRAL_MAX_M_S2
        integral = self._integral
        gains = (INTEGRAL_1_S2, INTEGRAL_1_S2, CLIMB_INTEGRAL_1_S2)
        for axis, error in enumerate((error_n, error_e, error_d)):
            integral[axis] = min(max(integral[axis] + gains[axis] * error * seconds, -limit), limit)
        an = VELOCITY_1_S * error_n + integral[0]
        ae = VELOCITY_1_S * error_e + integral[1]
        ad = CLIMB_1_S * error_d + integral[2]
        self._command(min(max(ad, -8.0), 6.0), an, ae, target, estimate, body, seconds)

    def _velocity_setpoint(self, target: Target, estimate: Estimator, seconds: float) -> tuple[float, float, float]:
        vn, ve, vd = target.vn, target.ve, target.vd
        if target.n == target.n and target.e == target.e:
            dn, de = target.n - estimate.n, target.e - estimate.e
            distance = math.sqrt(dn * dn + de * de)
            if distance > 1e-6:
                speed = min(approach_speed(distance, POSITION_1_S, BRAKE_M_S2), target.speed_max)
                vn += speed * dn / distance
                ve += speed * de / distance
        if target.d == target.d:
            dd = target.d - estimate.d
            vd += math.copysign(approach_speed(abs(dd), HEIGHT_1_S, HEIGHT_BRAKE_M_S2), dd)
        vd = min(max(vd, -target.climb_max), target.sink_max)
        speed = math.sqrt(vn * vn + ve * ve)
        if speed > target.speed_max:
            vn, ve = vn * target.speed_max / speed, ve * target.speed_max / speed
        held = self._velocity
        step_n, step_e = vn - held[0], ve - held[1]
        step = math.sqrt(step_n * step_n + step_e * step_e)
        share = min(1.0, SLEW_M_S2 * seconds / step) if step > 0 else 1.0
        held[0] += share * step_n
        held[1] += share * step_e
        most = HEIGHT_SLEW_M_S2 * seconds
        held[2] += min(max(vd - held[2], -most), most)
        return held[0], held[1], held[2]

    def _command(
        self, ad: float, an: float, ae: float, target: Target, estimate: Estimator, body: Body, seconds: float
    ) -> None:
        lift = GRAVITY - ad
        sideways = math.sqrt(an * an + ae * ae)
        most = lift * math.tan(self._tilt_max)
        if sideways > most:
            an, ae, sideways = an * most / sideways, ae * most / sideways, most
        thrust = math.sqrt(lift * lift + sideways * sideways)
        cy, sy = math.cos(estimate.yaw), math.sin(estimate.yaw)
        forward, right = an * cy + ae * sy, ae * cy - an * sy
        body.roll_command = math.asin(right / thrust)
        body.pitch_command = math.atan2(-forward, lift)
        body.thrust_command = min(thrust, 2.2 * GRAVITY)
        if target.yaw == target.yaw:
            self._yaw = target.yaw
        else:
            self._yaw += target.yaw_rate * seconds
        self.yaw_target = self._yaw
        body.yaw_command = self._yaw - estimate.yaw_bias


def approach_speed(distance: float, gain: float, brake: float) -> float:
    """Speed toward a point so far away: proportional when near, and never too fast to stop in time with `brake`."""
    near = brake / (gain * gain)
    return gain * distance if distance <= near else math.sqrt(2 * brake * (distance - near / 2))
