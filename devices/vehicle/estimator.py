"""What the autopilot believes: the truth with a constant offset, a slow drift, jitter, a heading bias, and jumps."""

from __future__ import annotations

import math

import numpy as np

from devices.vehicle.body import Body, wrap
from devices.world.settings import Gps

VALID_AFTER_S = 4.0
_VELOCITY_NOISE_M_S = 0.02
_TILT_NOISE = math.radians(0.1)
_JITTER_LAG_S = 0.15


class Estimator:
    """Estimated state, plain floats in SI units. `update` follows the body; `error` is estimate minus truth in NED.

    Local NED starts where the estimator starts, so the constant GPS offset shows both in the local position and in the
    global one: a site surveyed in the world is missed by it.
    """

    def __init__(self, settings: Gps, yaw_bias: float, rng: np.random.Generator) -> None:
        self._rng = rng
        self._drift_rate = settings.drift_m_min / math.sqrt(60.0)
        self._noise = settings.noise_m
        self._slow = [settings.offset_north_m, settings.offset_east_m, settings.offset_down_m]
        self._jitter = [0.0, 0.0, 0.0]
        self.yaw_bias = yaw_bias
        self.n = self.e = self.d = 0.0
        self.vn = self.ve = self.vd = 0.0
        self.roll = self.pitch = self.yaw = 0.0
        self.roll_rate = self.pitch_rate = self.yaw_rate = 0.0
        self.resets = 0
        self.last_jump = (0.0, 0.0, 0.0)

    @property
    def error(self) -> tuple[float, float, float]:
        """Offset, drift and jumps now, (north, east, down) m, without the jitter."""
        return self._slow[0], self._slow[1], self._slow[2]

    @property
    def sigma_m(self) -> float:
        """Horizontal standard deviation that the estimator claims."""
        return 0.4

    def jump(self, north_m: float, east_m: float, down_m: float) -> None:
        """Move the estimate at once, as an EKF does when it resets to a new GPS position."""
        for axis, step in enumerate((north_m, east_m, down_m)):
            self._slow[axis] += step
        self.last_jump = (north_m, east_m, down_m)
        self.resets += 1

    def update(self, body: Body, seconds: float) -> None:
        """The estimate after so many seconds since the last."""
        noise = self._rng.standard_normal(12).tolist()
        walk = self._drift_rate * math.sqrt(seconds)
        keep = math.exp(-seconds / _JITTER_LAG_S)
        fresh = self._noise * math.sqrt(1 - keep * keep)
        slow, jitter = self._slow, self._jitter
        for axis in (0, 1, 2):
            slow[axis] += walk * noise[axis]
            jitter[axis] = keep * jitter[axis] + fresh * noise[3 + axis]
        self.n = body.n + slow[0] + jitter[0]
        self.e = body.e + slow[1] + jitter[1]
        self.d = body.d + slow[2] + jitter[2]
        self.vn = body.vn + _VELOCITY_NOISE_M_S * noise[6]
        self.ve = body.ve + _VELOCITY_NOISE_M_S * noise[7]
        self.vd = body.vd + _VELOCITY_NOISE_M_S * noise[8]
        self.roll = body.roll + _TILT_NOISE * noise[9]
        self.pitch = body.pitch + _TILT_NOISE * noise[10]
        self.yaw = wrap(body.yaw + self.yaw_bias + _TILT_NOISE * noise[11])
        self.roll_rate, self.pitch_rate, self.yaw_rate = body.roll_rate, body.pitch_rate, body.yaw_rate
