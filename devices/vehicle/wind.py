"""Wind with Dryden-like gusts: coloured noise whose time scale is the turbulence length over the wind speed."""

from __future__ import annotations

import math

import numpy as np

from devices.world.settings import Wind

_LENGTH_M = (250.0, 250.0, 80.0)  # longitudinal, lateral, vertical at hub height (MIL-F-8785C, low altitude)


class WindField:
    """The wind where the vehicle is, as (north, east, down) in m/s; `step` moves it on.

    The mean blows from `from_deg`. Gusts are first-order Gauss-Markov in each axis of the wind, so strong that the
    speed along the wind reaches `gust_m_s` at three standard deviations, and held to that.
    """

    def __init__(self, settings: Wind, rng: np.random.Generator) -> None:
        self._rng = rng
        self._gust = [0.0, 0.0, 0.0]
        self._extra = (0.0, 0.0)
        self.velocity = (0.0, 0.0, 0.0)
        self.set(settings)
        for axis, sigma in enumerate(self._sigmas):
            self._gust[axis] = sigma * float(rng.standard_normal())
        self.step(0.0)

    def set(self, settings: Wind) -> None:
        """Change mean, gusts and direction from now on."""
        self.settings = settings
        peak = max(settings.gust_m_s - settings.mean_m_s, 0.0)
        self._peak = peak
        self._sigmas = (peak / 3, peak / 3, peak / 6)
        toward = math.radians(settings.from_deg) + math.pi
        self._north, self._east = math.cos(toward), math.sin(toward)

    def add(self, speed_m_s: float, from_deg: float | None = None) -> None:
        """One more gust on top, until called with zero."""
        toward = math.radians(self.settings.from_deg if from_deg is None else from_deg) + math.pi
        self._extra = (speed_m_s * math.cos(toward), speed_m_s * math.sin(toward))

    def step(self, seconds: float) -> None:
        """Let so many seconds pass."""
        gust, peak = self._gust, self._peak
        speed = max(self.settings.mean_m_s, 2.0)
        noise = self._rng.standard_normal(3).tolist()
        for axis in (0, 1, 2):
            keep = math.exp(-seconds * speed / _LENGTH_M[axis])
            value = keep * gust[axis] + self._sigmas[axis] * math.sqrt(1 - keep * keep) * noise[axis]
            gust[axis] = min(max(value, -peak), peak)
        along = self.settings.mean_m_s + gust[0]
        n, e, across = self._north, self._east, gust[1]
        self.velocity = (along * n - across * e + self._extra[0], along * e + across * n + self._extra[1], gust[2])
