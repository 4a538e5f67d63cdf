"""A two-axis gimbal and its manager (MAVLink gimbal protocol v2): who may steer it, and how it follows."""

from __future__ import annotations

import math

import numpy as np

from devices.vehicle.body import wrap
from devices.world.settings import Vehicle

PITCH_RANGE = (math.radians(-110.0), math.radians(80.0))
YAW_RANGE = (math.radians(-170.0), math.radians(170.0))
_READING_NOISE = math.radians(0.05)


class Gimbal:
    """True angles `yaw` (from north) and `pitch` (up from the horizon) in radians; roll is held at zero.

    `primary` is the (system, component) in control, None while nobody is. Without control, or after a yaw-follow
    command, the yaw turns with the vehicle; after a yaw-lock command it keeps its direction in the world as the
    autopilot knows it.
    """

    def __init__(self, settings: Vehicle, yaw: float, rng: np.random.Generator) -> None:
        self._lag = max(settings.gimbal_lag_s, 0.01)
        self._rate_max = math.radians(settings.gimbal_rate_deg_s)
        self._rng = rng
        self.primary: tuple[int, int] | None = None
        self.yaw, self.pitch = yaw, 0.0
        self.yaw_lock = False
        self.yaw_setpoint = self.pitch_setpoint = 0.0
        self.yaw_rate = self.pitch_rate = 0.0
        self.stuck = False
        self.reading = (yaw, 0.0)

    def take(self, system: int, component: int) -> None:
        """Give control to a component."""
        self.primary = (system, component)

    def release(self) -> None:
        """Nobody is in control; look ahead again."""
        self.primary = None
        self.yaw_lock = False
        self.yaw_setpoint = self.pitch_setpoint = 0.0

    def point(self, pitch: float, yaw: float, yaw_lock: bool) -> None:
        """New angles in radians, NaN for no change: yaw from the vehicle's nose, or from north with `yaw_lock`."""
        if math.isfinite(pitch):
            self.pitch_setpoint = min(max(pitch, PITCH_RANGE[0]), PITCH_RANGE[1])
        if math.isfinite(yaw):
            self.yaw_setpoint = wrap(yaw)
            self.yaw_lock = yaw_lock

    def step(self, body_yaw: float, yaw_bias: float, seconds: float) -> None:
        """Follow for so many seconds; `yaw_bias` is the error of the heading that the gimbal is given."""
        relative = wrap(self.yaw_setpoint - yaw_bias - body_yaw) if self.yaw_lock else self.yaw_setpoint
        wanted = body_yaw + min(max(relative, YAW_RANGE[0]), YAW_RANGE[1])
        if self.stuck:
            self.yaw_rate = self.pitch_rate = 0.0
        else:
            gain, limit = (1.0 - math.exp(-seconds / self._lag)) / seconds, self._rate_max
            self.yaw_rate = min(max(gain * wrap(wanted - self.yaw), -limit), limit)
            self.pitch_rate = min(max(gain * (self.pitch_setpoint - self.pitch), -limit), limit)
        self.yaw = wrap(self.yaw + self.yaw_rate * seconds)
        self.pitch += self.pitch_rate * seconds
        noise = self._rng.standard_normal(2).tolist()
        self.reading = (
            wrap(self.yaw + yaw_bias + _READING_NOISE * noise[0]),
            self.pitch + _READING_NOISE * noise[1],
        )
