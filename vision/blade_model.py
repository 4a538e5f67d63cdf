"""The blade as the tracker models it: a plane and two edges around a reference point that moves with the view.

State (20,): depth of the surface at the reference (m), d depth / d station, d depth / d offset; offset (m) and slope
per metre of station of the leading edge, and of the trailing edge; how all these slopes change along the blade (1/m),
and the slope across it; by how much the vehicle's position trembles now (m); by how much the camera is turned against
its reported angles (rad); how far behind the surface each edge lies (m). All are in the blade frame of
`vision.estimate`, as a camera *shows* the blade that is where and as its reports say. `vision.blade_motion` says how it
all moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from filterpy import kalman
from numpy.typing import NDArray

from vision.blade_motion import (
    BLADE,
    EDGE,
    EDGE_CURVATURE,
    PLANE,
    RECESS,
    SIZE,
    TREMBLE,
    TURNED,
    Side,
    carried,
    curvature_sigmas,
    passing,
    passing_noise,
    recess_sigma,
    shifted,
    travel,
    travel_noise,
)
from vision.tracker_settings import TrackerSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BladeModel:
    """Mean (20,) and covariance (20, 20) of the blade around the reference point (station, offset), as seen by a camera
    at `lens` (3,), blade coordinates; None where nobody knows any more from where."""

    station: float
    offset: float
    mean: Array
    covariance: Array
    lens: Array | None = None

    def depth_at(self, station: float, offset: float) -> float:
        """Depth (m) of the modelled surface."""
        depth, along, across = self.mean[PLANE]
        return float(depth + along * (station - self.station) + across * (offset - self.offset))

    def edge_at(self, side: Side, station: float) -> float:
        """Offset (m) of an edge."""
        offset, slope = self.mean[EDGE[side]]
        return float(offset + slope * (station - self.station))

    def seen_from(self, lens: Array) -> BladeModel:
        """The same blade as a camera elsewhere (3,) shows it."""
        if self.lens is None:
            return replace(self, lens=lens)
        mean, covariance = kalman.predict(self.mean, self.covariance, F=carried(self.mean, lens - self.lens), Q=0.0)
        return replace(self, lens=lens, mean=mean, covariance=covariance)

    def moved(self, station: float, offset: float, settings: TrackerSettings) -> BladeModel:
        """The same blade around another reference point, with the noise of what lies between (6.1)."""
        along, across = station - self.station, offset - self.offset
        mean, covariance = kalman.predict(
            self.mean,
            self.covariance,
            F=travel(along, across, station, settings),
            Q=travel_noise(along, across, station, settings),
        )
        return replace(self, station=station, offset=offset, mean=mean, covariance=covariance)

    def later(self, seconds: float, jitter_m: float, settings: TrackerSettings) -> BladeModel:
        """The same blade after the vehicle's position has drifted and trembled for so long."""
        mean, covariance = kalman.predict(
            self.mean,
            self.covariance,
            F=passing(seconds, settings),
            Q=passing_noise(self.mean, seconds, jitter_m, settings),
        )
        return replace(self, mean=mean, covariance=covariance)

    def as_shown(self) -> BladeModel:
        """The blade as the camera shows it at this moment, tremble of the reported position included."""
        shown = np.eye(SIZE)
        shown[BLADE, TREMBLE] = shifted(self.mean)
        return replace(self, mean=shown @ self.mean, covariance=shown @ self.covariance @ shown.T)

    def corrected(self, z: Array, R: Array, H: Array) -> BladeModel:
        """The blade after a measurement z (m,) = H x + noise of covariance R (6.4 to 6.7)."""
        mean, covariance = kalman.update(self.mean, self.covariance, z, R, H)
        return replace(self, mean=mean, covariance=(covariance + covariance.T) / 2)

    def inflated(self, values: slice, sigmas: Array) -> BladeModel:
        """The blade with part of its state less certain by `sigmas`."""
        covariance = self.covariance.copy()
        covariance[values, values] += np.diag(np.square(sigmas))
        return replace(self, covariance=covariance)

    def without(self, side: Side, settings: TrackerSettings) -> BladeModel:
        """The blade with one edge as unknown as before it was seen."""
        unknown = prior(self.station, self.offset, self.lens, 0.0, settings)
        mean, covariance = self.mean.copy(), self.covariance.copy()
        rows = [EDGE[side].start, EDGE[side].start + 1, EDGE_CURVATURE[side], RECESS[side]]
        mean[rows] = 0.0
        covariance[rows, :] = covariance[:, rows] = 0.0
        covariance[np.ix_(rows, rows)] = unknown.covariance[np.ix_(rows, rows)]
        return replace(self, mean=mean, covariance=covariance)


def prior(station: float, offset: float, lens: Array | None, jitter_m: float, settings: TrackerSettings) -> BladeModel:
    """What the survey alone says: a flat blade in the frame's own plane, with wide margins."""
    sigmas = np.zeros(SIZE)
    sigmas[PLANE] = settings.prior_depth_m, settings.prior_depth_slope, settings.prior_across_slope
    for rows in EDGE.values():
        sigmas[rows] = settings.prior_offset_m, settings.prior_offset_slope
    for value, sigma in curvature_sigmas(station, settings).items():
        sigmas[value] = sigma
    for value in RECESS.values():
        sigmas[value] = recess_sigma(station, settings)
    sigmas[TREMBLE], sigmas[TURNED] = jitter_m, settings.turned
    return BladeModel(station, offset, np.zeros(SIZE), np.diag(sigmas**2), lens)
