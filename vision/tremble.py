"""Learns how much the vehicle's reported place and the camera's reported angles tremble, and how much of what the eye
claims is new in every frame, from how much the blade seems to.

Telemetry does not say it, and it differs from one vehicle to the next by more than ten times; the eye claims what its
depth and lines may be off in all, most of which stays the same while it looks at the same surface. The innovations
tell: each is a sample of noise whose covariance is linear in the variances, and the scoring steps of maximum likelihood
(Fisher), the last samples counting most, follow these.
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
REMEMBERED = 100  # samples after which one has been forgotten
CLAIM = 10  # samples that the first guess is worth


@dataclass(frozen=True)
class Tremble:
    """Sigmas: jitter_m of each axis of the position, attitude (rad) of the camera's angles about its own axes: a gimbal
    holds some better than others; surface, edges: of what is new in a frame, as shares of what the eye claims. known
    (6,): Fisher's information on their squares, in that order; innovations that say little of one change it little."""

    jitter_m: float
    attitude: tuple[float, float, float]
    surface: float
    edges: float
    known: tuple[float, ...]

    @classmethod
    def claimed(cls, settings: TrackerSettings) -> Tremble:
        """What is assumed before anything was seen."""
        place, angle = settings.claimed_jitter_m, settings.claimed_attitude
        share = settings.claimed_fresh
        first = (place, angle, angle, angle, share, share)
        return cls(place, (angle, angle, angle), share, share, tuple(CLAIM / sigma**4 for sigma in first))

    def learnt(self, model: BladeModel, used: Measurement, seconds: float, settings: TrackerSettings) -> Tremble:
        """After an innovation: model before the measurement that was used, `seconds` after the one before."""
        # A part of the trembling is the last frame's and known by now: what is new scales with its variance.
        fresh = -np.expm1(-2 * max(seconds, 0.0) / settings.jitter_s)
        if not fresh > 0.1:
            return self
        innovation = used.z - used.H @ model.mean
        inverse = np.linalg.inv(used.H @ model.covariance @ used.H.T + used.R)
        whitened = inverse @ innovation

        def scored(sigma: float, known: float, causes: Array, limits: tuple[float, float]) -> tuple[float, float]:
            """causes (m, k): what the k independent parts of the noise, each of sigma one, do to the measurement."""
            share = causes.T @ inverse @ causes
            score = float(np.square(causes.T @ whitened).sum()) - float(np.trace(share))
            known = known * (1 - 1 / REMEMBERED) + float(np.square(share).sum())
            return float(np.sqrt(np.clip(sigma**2 + score / known, limits[0] ** 2, limits[1] ** 2))), known

        sigmas = (self.jitter_m, *self.attitude, self.surface, self.edges)
        turning = [used.turning[:, [axis]] for axis in range(3)]
        causes = (np.sqrt(fresh) * used.H[:, TREMBLE], *turning, used.surface, used.edges)
        limits = (settings.jitter_m, *(settings.attitude,) * 3, settings.fresh, settings.fresh)
        found = [scored(*each) for each in zip(sigmas, self.known, causes, limits, strict=True)]
        jitter_m, roll, pitch, yaw, surface, edges = (sigma for sigma, _ in found)
        return Tremble(jitter_m, (roll, pitch, yaw), surface, edges, tuple(known for _, known in found))
