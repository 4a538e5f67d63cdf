"""Tip and root along the blade: where single sightings add up to a fact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera
from vision.capture import CameraPose
from vision.estimate import BladeEstimate, BladeFrame
from vision.observation import BladeObservation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TipSighting:
    """One observed tip: when, and at which station (m from the hub along the span) it lies."""

    stamp_s: float
    station_m: float


def sight_tip(
    observation: BladeObservation, estimate: BladeEstimate, pose: CameraPose, frame: BladeFrame, camera: Camera
) -> TipSighting | None:
    """The station of an observed tip, where the ray through its image point meets the tracked surface, or None."""
    if observation.tip is None or not observation.valid:
        return None
    ray = pose.rotation @ camera.rays(observation.tip.point[None] + camera.centre)[0]
    toward = float(ray @ estimate.normal)
    if abs(toward) < 0.2:
        return None
    reach = float((estimate.point - pose.position) @ estimate.normal) / toward
    station = float(frame.to_blade(pose.position + reach * ray)[0])
    return TipSighting(observation.stamp_s, station)


def agreed_tip(
    sightings: Sequence[TipSighting], since_s: float, *, least: int = 3, spread_m: float = 0.5
) -> float | None:
    """The median station of the sightings since a time, if there are enough and they agree; else None."""
    stations = np.array([sighting.station_m for sighting in sightings if sighting.stamp_s >= since_s])
    if len(stations) < least:
        return None
    middle = float(np.median(stations))
    agreeing = np.abs(stations - middle) <= spread_m
    return middle if agreeing.sum() >= max(least, 0.6 * len(stations)) else None


@dataclass
class EdgeMap:
    """Both edges as they were seen along the blade: per station the offset in the blade frame, in bins of half a metre.

    The chord of a wide blade never fits into one view; it is the leading edge of the way out minus the trailing edge of
    the way back.
    """

    bin_m: float = 0.5
    fresh_s: float = 0.5
    offsets: dict[str, dict[int, float]] = field(default_factory=lambda: {"leading": {}, "trailing": {}})

    def add(self, estimate: BladeEstimate) -> None:
        """Note the edges that were seen just now."""
        key = round(estimate.station_m / self.bin_m)
        for name, side in (("leading", estimate.leading), ("trailing", estimate.trailing)):
            if side is not None and side.age_s <= self.fresh_s:
                self.offsets[name][key] = side.offset_m

    def chord(self, station_m: float) -> float | None:
        """The chord (m) at a station, None where one of the edges was not seen within a metre and a half of it."""
        at = []
        for name in ("leading", "trailing"):
            known = self.offsets[name]
            if not known:
                return None
            keys = np.array(sorted(known))
            wanted = station_m / self.bin_m
            if np.abs(keys - wanted).min() * self.bin_m > 1.5:
                return None
            at.append(float(np.interp(wanted, keys, [known[key] for key in keys])))
        return at[0] - at[1]


@dataclass
class RootWatch:
    """Watches the chord on the way to the root: it grows, then falls steadily.

    `fall` is the share of the largest chord at which the root is near; `radius_m` the station inside
    which the position must confirm it. `update` returns the station at which both agree.
    """

    radius_m: float
    fall: float = 0.75
    least_chords: int = 6
    chords: list[tuple[float, float]] = field(default_factory=list)

    def update(self, station_m: float, chord_m: float | None) -> float | None:
        """Add one chord (m) at a station (m); returns the station once the root is reached, else None."""
        if chord_m is not None and chord_m > 0:
            self.chords.append((station_m, chord_m))
        if len(self.chords) < self.least_chords or station_m > self.radius_m:
            return None
        stations, chords = np.array(self.chords).T
        widest = int(np.argmax(chords))
        recent = float(np.median(chords[-3:]))
        after = stations[widest] - station_m
        return station_m if recent <= self.fall * chords[widest] and after > 1.0 else None
