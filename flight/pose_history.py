"""Where the vehicle was: samples of position, attitude and gimbal that come at different times, joined at any time."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from math import nan

import numpy as np
from numpy.typing import NDArray

from flight.autopilot import VehiclePose
from flight.guidance.angles import difference

Array = NDArray[np.float64]

AHEAD_S = 0.5  # how far beyond the last sample a pose is extrapolated


class Track:
    """Samples (stamp, values) in order of time over the last `keep_s` seconds; late ones are dropped."""

    def __init__(self, keep_s: float) -> None:
        self._keep_s = keep_s
        self._samples: deque[tuple[float, tuple[float, ...]]] = deque()

    def add(self, stamp_s: float, values: tuple[float, ...]) -> None:
        if self._samples and stamp_s <= self._samples[-1][0]:
            if stamp_s < self._samples[-1][0]:
                return
            self._samples.pop()
        self._samples.append((stamp_s, values))
        while self._samples[0][0] < stamp_s - self._keep_s:
            self._samples.popleft()

    def clear(self) -> None:
        self._samples.clear()

    @property
    def last(self) -> tuple[float, tuple[float, ...]] | None:
        return self._samples[-1] if self._samples else None

    def around(self, stamp_s: float) -> tuple[tuple[float, ...], tuple[float, ...], float] | None:
        """The samples before and after, and the share of the way between them; None outside the record."""
        samples = list(self._samples)
        if not samples or stamp_s < samples[0][0]:
            return None
        if stamp_s >= samples[-1][0]:
            if stamp_s - samples[-1][0] > AHEAD_S:
                return None
            return samples[-1][1], samples[-1][1], 0.0
        after = bisect_left(samples, stamp_s, key=lambda sample: sample[0])
        if samples[after][0] == stamp_s:
            return samples[after][1], samples[after][1], 0.0
        (before_s, before), (after_s, values) = samples[after - 1], samples[after]
        return before, values, (stamp_s - before_s) / (after_s - before_s)


class PoseHistory:
    """The last seconds of a vehicle. One thread adds; any thread may ask."""

    def __init__(self, keep_s: float = 10.0) -> None:
        self.position = Track(keep_s)  # north, east, down, and their velocities
        self.attitude = Track(keep_s)  # roll, pitch, yaw
        self.gimbal = Track(keep_s)  # yaw from north, pitch from the horizon

    def clear(self) -> None:
        """Forget everything, as when the vehicle's clock began anew."""
        for track in (self.position, self.attitude, self.gimbal):
            track.clear()

    def at(self, stamp_s: float) -> VehiclePose | None:
        """The pose at a time, interpolated, or up to half a second beyond the last sample; None elsewhere. Without any
        gimbal its angles are NaN."""
        position, attitude = self.position.around(stamp_s), self.attitude.around(stamp_s)
        last = self.position.last
        if position is None or attitude is None or last is None:
            return None
        before, after, share = (np.array(position[0]), np.array(position[1]), position[2])
        moved = before + share * (after - before)
        if stamp_s > last[0]:
            moved[:3] += (stamp_s - last[0]) * moved[3:]
        gimbal = self.gimbal.around(stamp_s)
        angles = np.array([nan, nan]) if gimbal is None else _turned(*gimbal)
        return VehiclePose(stamp_s, moved[:3], moved[3:], _turned(*attitude), angles)

    def latest(self) -> VehiclePose | None:
        """The pose at the last position; None before the first position and attitude."""
        last, attitude, gimbal = self.position.last, self.attitude.last, self.gimbal.last
        if last is None or attitude is None:
            return None
        pose = self.at(last[0])
        if pose is not None and not np.isnan(pose.gimbal[0]):
            return pose
        values = np.array(last[1])
        angles = np.array([nan, nan] if gimbal is None else gimbal[1])
        return VehiclePose(last[0], values[:3], values[3:], np.array(attitude[1]), angles)


def _turned(before: tuple[float, ...], after: tuple[float, ...], share: float) -> Array:
    return np.array([a + share * difference(b, a) for a, b in zip(before, after, strict=True)])
