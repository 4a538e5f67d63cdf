"""Learns how much the vehicle's reported place and the camera's reported angles tremble, from how much the blade seems
to.

Telemetry does not say it, and it differs from one vehicle to the next by more than ten times. The innovations do: each
is a sample of noise whose covariance is linear in the trembling's variances, and the scoring step of maximum likelihood
(Fisher) over the last of them follows these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vision.blade_measurement import Measurement
from vision.blade_model import BladeModel
from vision.blade_motion import TREMBLE
from vision.tracker_settings import TrackerSettings

Array = NDArray[np.float64]
REMEMBERED = 100  # samples that count
CLAIM = 10  # samples that the first guess is worth


@dataclass(frozen=True)
class Tremble:
    """Sigmas of each axis: jitter_m of the position, attitude (rad) of the camera's angles. samples: innovations that
    they were learnt from."""

    jitter_m: float
    attitude: float
    samples: float = CLAIM

    def learnt(self, model: BladeModel, used: Measurement, seconds: float, settings: TrackerSettings) -> Tremble:
        """After an innovation: model before the measurement that was used, `seconds` after the one before."""
        # A part of the trembling is the last frame's and known by now: what is new scales with its variance.
        fresh = -np.expm1(-2 * max(seconds, 0.0) / settings.jitter_s)
        if not fresh > 0.1:
            return self
        innovation = used.z - used.H @ model.mean
        inverse = np.linalg.inv(used.H @ model.covariance @ used.H.T + used.R)
        samples = min(self.samples + 1, REMEMBERED)

        def scored(sigma: float, noise: Array, least: float, most: float) -> float:
            share = inverse @ noise
            score = float(innovation @ share @ inverse @ innovation) - float(np.trace(share))
            step = score / max(float(np.trace(share @ share)), 1e-9) / samples
            return float(np.sqrt(np.clip(sigma**2 + step, least**2, most**2)))

        place, angles = used.H[:, TREMBLE], used.turning
        return Tremble(
            scored(self.jitter_m, fresh * place @ place.T, *settings.jitter_m),
            scored(self.attitude, angles @ angles.T, *settings.attitude),
            samples,
        )
