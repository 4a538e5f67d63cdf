"""What the tracker believes of the blade now, in a frame that stays still while the vehicle moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vision.observation import Line

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BladeFrame:
    """Where the blade is thought to lie, in local NED, fixed from the survey until it is told to forget.

    origin (3,): hub centre. Unit vectors (3,): `span` from the hub to the tip, `across` toward the leading side, at
    right angles to it in the rotor plane, and `depth` away from the vehicle, from the front to the back. Points of
    the blade have coordinates (station, offset, depth) in metres along these.
    """

    origin: Array
    span: Array
    across: Array
    depth: Array

    @property
    def rotation(self) -> Array:
        """(3, 3): rows are span, across, depth: blade coordinates are `rotation @ (p - origin)`."""
        return np.stack([self.span, self.across, self.depth])

    def to_blade(self, points: Array) -> Array:
        """Local NED points (n, 3) or (3,) in (station, offset, depth)."""
        result: Array = (points - self.origin) @ self.rotation.T
        return result

    def to_ned(self, points: Array) -> Array:
        """Points (n, 3) or (3,) of (station, offset, depth) in local NED."""
        result: Array = points @ self.rotation + self.origin
        return result


@dataclass(frozen=True)
class SideEstimate:
    """One edge as tracked: its offset (m, along `across`) at the present station, the slope per metre of station,
    and both standard deviations; `line` is it as the left camera would see it now (None where it cannot), `age_s`
    since last seen."""

    offset_m: float
    slope: float
    offset_sigma_m: float
    slope_sigma: float
    age_s: float
    line: Line | None
    outward: Array | None


@dataclass(frozen=True)
class BladeEstimate:
    """State and covariance of the blade around `station_m`, predicted to `stamp_s` and seen from the pose of that time.

    age_s: since the last accepted observation. distance_m: from the left camera along the optical axis to the
    surface, with its sigma. nearest_m: from the camera to the nearest point of the tracked surface between its
    edges. normal (3,): of the surface, local NED, toward the vehicle. point (3,): where the optical axis meets the
    surface, local NED.
    depth_m, depth_slope, across_slope: the surface in blade coordinates, depth = depth_m + depth_slope (s - station_m)
    + across_slope (n - offset of `point`). leading, trailing: the edges, None before first seen.
    heading: direction from root to tip in the image now, radians. state (7,), covariance (7, 7): plane and edges,
    for the record.
    """

    stamp_s: float
    age_s: float
    station_m: float
    distance_m: float
    distance_sigma_m: float
    nearest_m: float
    normal: Array
    point: Array
    depth_m: float
    depth_slope: float
    across_slope: float
    leading: SideEstimate | None
    trailing: SideEstimate | None
    heading: float
    heading_sigma: float
    chord_m: float | None
    chord_sigma_m: float | None
    state: Array
    covariance: Array
