"""The blade as the tracker models it: a plane and two straight edges around a reference point that moves with the view.

State (7,): depth of the surface at the reference (m), d depth / d station, d depth / d offset, then offset (m) and
slope per metre of station of the leading edge, and of the trailing edge. All are in the blade frame of
`vision.estimate`. The blade stands still; moving the reference along it is the control input of (6.1), exact but for
taper, twist and curvature, which enter as noise per metre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from filterpy import kalman
from numpy.typing import NDArray

Array = NDArray[np.float64]
Side = Literal["leading", "trailing"]

SIZE: Final = 7
DEPTH, DEPTH_SLOPE, ACROSS_SLOPE = 0, 1, 2
PLANE: Final = slice(0, 3)
EDGE: Final[dict[Side, slice]] = {"leading": slice(3, 5), "trailing": slice(5, 7)}
SIDES: Final[tuple[Side, Side]] = ("leading", "trailing")
SIGN: Final[dict[Side, float]] = {"leading": 1.0, "trailing": -1.0}


@dataclass(frozen=True)
class TrackerSettings:
    """What the tracker assumes of blade, vehicle and observations. Lengths in metres, angles in radians, slopes in m/m.

    prior_*: how far the survey may be wrong where nothing has been seen. *_per_root_m: random walk of a slope per
    square root of a metre travelled (taper, twist, bend). round_*: near the root the blade is as round as a barrel, and
    its slope across turns within a hand's breadth; fully so inside the first station, no more beyond the second.
    drift_*: random walk of the vehicle's local position. attitude_sigma: of the camera's angles. surface_*, edge_*:
    what plane and straight line leave out at 3 m, added to what an observation claims. gate: share of good measurements
    that each χ² gate lets pass. confirmations: agreeing observations before anything is estimated. After `patience`
    rejections in a row the covariance is inflated at each one by inflation_m and inflation_slope, up to
    inflation_limit_m; after `restart_after` in a row that agree among themselves, within the prior and no deeper than
    restart_deeper_m behind the tracked surface, the tracker starts again from them. history_s: how late an observation
    may be.
    """

    prior_depth_m: float = 3.0
    prior_depth_slope: float = 0.15
    prior_across_slope: float = 0.6
    prior_offset_m: float = 3.0
    prior_offset_slope: float = 0.3
    depth_slope_per_root_m: float = 0.03
    across_slope_per_root_m: float = 0.08
    round_across_slope_per_root_m: float = 0.5
    round_within_m: tuple[float, float] = (4.0, 9.0)
    leading_slope_per_root_m: float = 0.04
    trailing_slope_per_root_m: float = 0.08
    drift_m_per_root_s: float = 0.02
    attitude_sigma: float = 0.003
    surface_sigma_m: float = 0.005
    surface_slope_sigma: float = 0.01
    edge_sigma_m: float = 0.008
    edge_slope_sigma: float = 0.006
    edge_depth_sigma_m: float = 0.03
    gate: float = 0.997
    confirmations: int = 2
    patience: int = 3
    inflation_m: float = 0.1
    inflation_slope: float = 0.03
    inflation_limit_m: float = 0.25
    restart_after: int = 6
    restart_deeper_m: float = 1.0
    history_s: float = 1.0


@dataclass(frozen=True)
class BladeModel:
    """Mean (7,) and covariance (7, 7) of the blade around the reference point (station, offset)."""

    station: float
    offset: float
    mean: Array
    covariance: Array

    def depth_at(self, station: float, offset: float) -> float:
        """Depth (m) of the modelled surface."""
        depth, along, across = self.mean[PLANE]
        return float(depth + along * (station - self.station) + across * (offset - self.offset))

    def edge_at(self, side: Side, station: float) -> float:
        """Offset (m) of an edge."""
        offset, slope = self.mean[EDGE[side]]
        return float(offset + slope * (station - self.station))

    def moved(self, station: float, offset: float, settings: TrackerSettings) -> BladeModel:
        """The same blade around another reference point, with the noise of what lies between (6.1)."""
        along, across = station - self.station, offset - self.offset
        mean, covariance = kalman.predict(
            self.mean, self.covariance, F=moving(along, across), Q=travel_noise(along, across, station, settings)
        )
        return BladeModel(station, offset, mean, covariance)

    def drifted(self, seconds: float, settings: TrackerSettings) -> BladeModel:
        """The same blade after the vehicle's local position has drifted for so long."""
        mean, covariance = kalman.predict(self.mean, self.covariance, Q=drift_noise(self.mean, seconds, settings))
        return replace(self, mean=mean, covariance=covariance)

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
        unknown = prior(self.station, self.offset, settings)
        mean, covariance = self.mean.copy(), self.covariance.copy()
        rows = EDGE[side]
        mean[rows] = 0.0
        covariance[rows, :] = covariance[:, rows] = 0.0
        covariance[rows, rows] = unknown.covariance[rows, rows]
        return replace(self, mean=mean, covariance=covariance)


def moving(along: float, across: float) -> Array:
    """Φ (7, 7) of a reference point that moves by `along` metres of station and `across` metres of offset."""
    transition = np.eye(SIZE)
    transition[DEPTH, DEPTH_SLOPE] = along
    transition[DEPTH, ACROSS_SLOPE] = across
    for side in SIDES:
        transition[EDGE[side].start, EDGE[side].start + 1] = along
    return transition


def travel_noise(along: float, across: float, station: float, settings: TrackerSettings) -> Array:
    """Q (7, 7) of moving the reference to a station: slopes wander, and what they lead to wanders as their integral."""
    noise = np.zeros((SIZE, SIZE))

    def wander(value: int, slope: int, per_root_m: float, distance: float) -> None:
        length = abs(distance)
        noise[value, value] += per_root_m**2 * length**3 / 3
        noise[value, slope] += per_root_m**2 * length * distance / 2
        noise[slope, value] = noise[value, slope]
        noise[slope, slope] += per_root_m**2 * length

    wander(DEPTH, DEPTH_SLOPE, settings.depth_slope_per_root_m, along)
    flat, roundness = settings.across_slope_per_root_m, settings.round_across_slope_per_root_m
    turning = float(np.interp(station, settings.round_within_m, (roundness, flat)))
    wander(DEPTH, ACROSS_SLOPE, turning, across)
    noise[ACROSS_SLOPE, ACROSS_SLOPE] += flat**2 * abs(along)
    wander(EDGE["leading"].start, EDGE["leading"].start + 1, settings.leading_slope_per_root_m, along)
    wander(EDGE["trailing"].start, EDGE["trailing"].start + 1, settings.trailing_slope_per_root_m, along)
    return noise


def drift_noise(mean: Array, seconds: float, settings: TrackerSettings) -> Array:
    """Q (7, 7) of the local position drifting under the vehicle: the whole blade appears to shift as one."""
    shift = np.zeros((SIZE, 3))  # by station, offset and depth
    shift[DEPTH] = -mean[DEPTH_SLOPE], -mean[ACROSS_SLOPE], 1.0
    for side in SIDES:
        start = EDGE[side].start
        shift[start] = -mean[start + 1], 1.0, 0.0
    noise: Array = settings.drift_m_per_root_s**2 * max(seconds, 0.0) * shift @ shift.T
    return noise


def prior(station: float, offset: float, settings: TrackerSettings) -> BladeModel:
    """What the survey alone says: a flat blade in the frame's own plane, with wide margins."""
    edge = (settings.prior_offset_m, settings.prior_offset_slope)
    sigmas = np.array(
        [settings.prior_depth_m, settings.prior_depth_slope, settings.prior_across_slope, *edge, *edge],
    )
    return BladeModel(station, offset, np.zeros(SIZE), np.diag(sigmas**2))
