"""Inner loops over what speaks for lines: their typical steps, steps before them, missing dots."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]
Flags = NDArray[np.bool_]


@compiled
def _median(values: Floats) -> Any:
    """Median of a few values; they are put in order."""
    count = len(values)
    for k in range(1, count):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
    return 0.5 * (values[(count - 1) // 2] + values[count // 2])


@compiled
def median_steps(step: Floats, agrees: Flags, within: Flags, median: Floats) -> None:
    """Median (k,) of |step| (k, m) at the places that agree and lie within (k, m); zero where there is none."""
    lines, places = step.shape
    sizes = np.empty(places)
    for line in range(lines):
        count = 0
        for m in range(places):
            if agrees[line, m] and within[line, m]:
                sizes[count] = abs(step[line, m])
                count += 1
        median[line] = 0.0
        if count > 0:
            median[line] = _median(sizes[:count])


@compiled
def missing_dots(
    dots: Floats, absent: Floats, normal: Floats, rho: Floats, low: Floats, high: Floats, apart: float, reach: float,
    empty: Floats, beyond: NDArray[np.int64],
) -> None:  # fmt: skip
    """Of dots expected inside of k lines, between low and high (k,) along them, the share that is missing, and how many
    are missing up to `reach` px past them. dots (n, 2), absent (m, 2); nearer than `apart` to the line neither counts.
    """
    depth = np.empty(len(dots))
    for line in range(len(rho)):
        nx, ny = normal[line, 0], normal[line, 1]
        for k in range(len(dots)):
            depth[k] = dots[k, 0] * nx + dots[k, 1] * ny - rho[line]
        innermost = _median(depth)  # which leaves the depths in order
        there, gone, past = 0, 0, 0
        for k in range(len(dots)):
            there += depth[k] > innermost
        for k in range(len(absent)):
            along = absent[k, 1] * nx - absent[k, 0] * ny
            if low[line] - 10 < along < high[line] + 10:
                off = absent[k, 0] * nx + absent[k, 1] * ny - rho[line]
                gone += innermost < off < -apart
                past += apart < off < reach
        empty[line], beyond[line] = gone / max(gone + there, 1), past


@compiled
def line_of_most(places: Floats, depths: Floats, least_apart: float, within: float) -> tuple[float, float, int]:
    """(slope, shift, how many) of the line depth = shift + slope · place through two of n points, more than least_apart
    apart, that most of them lie within so far of; of equal ones that to which the others are nearest."""
    best, slope, shift, most = -np.inf, 0.0, 0.0, 0
    count = len(places)
    for a in range(count):
        for b in range(a + 1, count):
            if abs(places[b] - places[a]) <= least_apart:
                continue
            tried = (depths[b] - depths[a]) / (places[b] - places[a])
            at_zero = depths[a] - tried * places[a]
            agree, apart = 0, 0.0
            for k in range(count):
                off = abs(depths[k] - at_zero - tried * places[k])
                agree += off < within
                apart += min(off, 3.0 * within)
            if agree - 0.1 * apart / count > best:
                best, slope, shift, most = agree - 0.1 * apart / count, tried, at_zero, agree
    return slope, shift, most


@compiled
def without_shade(change: Floats, noise: float, across: int, gradual: float, most: int) -> None:
    """Takes from the first `most` samples of change (k, m, n), steps inward of k lines at m places, what they usually
    are where they only fade away inward: where the usual step, no greater than the one before but for noise, is more
    than a share `gradual` of that which lies `across` samples before it."""
    lines, places, samples = change.shape
    count = min(most, samples - across)
    usual, room = np.empty(count + across), np.empty(places)
    for line in range(lines):
        for i in range(count + across):
            for m in range(places):
                room[m] = change[line, m, i]
            usual[i] = _median(room)
            if i < across:
                continue
            k = i - across
            if usual[i] <= gradual * usual[k] or usual[k + 1] > usual[k] + noise:
                break
            for m in range(places):
                change[line, m, k] -= usual[k]


@compiled
def shares_above(change: Floats, thresholds: Floats) -> Floats:
    """Share (k,) of the places of each of k lines at which some sample of change (k, m, n) exceeds a threshold (k,)."""
    lines, places, samples = change.shape
    share = np.empty(lines)
    for line in range(lines):
        count = 0
        for m in range(places):
            most = -np.inf
            for i in range(samples):
                most = max(most, change[line, m, i])
            count += most > thresholds[line]
        share[line] = count / places
    return share


@compiled
def lines_before(
    change: Floats, places: Floats, thresholds: Floats, first_px: float, step_px: float, share: float, steepest: float,
    turns: Floats, shifts: Floats,
) -> None:  # fmt: skip
    """The line through the first steps that one meets before each of k lines, coming from the dots, where at least a
    share of the places has one and lies on it.

    change (k, m, n): steps at samples from first_px before the line on, step_px apart, at places (k, m) along it; those
    above a threshold (k,) count. Written: turns and shifts (k,), slope and offset against the line; NaN without one."""
    lines, count, samples = change.shape
    at, depth = np.empty(count), np.empty(count)
    for line in range(lines):
        turns[line] = shifts[line] = np.nan
        seen, low, high = 0, np.inf, -np.inf
        for m in range(count):
            low, high = min(low, places[line, m]), max(high, places[line, m])
            # The samples run inward: the last strong one is the first that one meets outward; its peak is near by.
            last = samples - 1
            while last >= 0 and not change[line, m, last] > thresholds[line]:
                last -= 1
            if last < 0:
                continue
            peak = last
            for i in (max(last - 1, 0), max(last - 2, 0)):
                if change[line, m, i] > change[line, m, peak]:
                    peak = i
            at[seen], depth[seen] = places[line, m], -(first_px + step_px * (peak + 1))
            seen += 1
        if not seen / count > share:
            continue
        slope, shift, agree = line_of_most(at[:seen], depth[:seen], 0.25 * (high - low), step_px)
        if agree >= share * count and abs(slope) <= steepest:
            turns[line], shifts[line] = slope, shift
