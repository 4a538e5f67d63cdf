"""Inner loops that lay out what is known beforehand of a blade's end: dots and missing dots against each outline."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]
Integers = NDArray[np.int64]


@compiled
def dots_in_lanes(
    dots: Floats, toward: Floats, low: Floats, high: Floats, wide: float, skew: float, lanes: Floats, room_px: float,
    shares: Floats, along: Floats, quiet: Floats,
) -> None:  # fmt: skip
    """Where dots (n, 2) lie between two sides of a blade: shares (n,) of the way from the lower to the upper, and along
    (n,) the direction `toward` (2,), the skew taken out; and of each lane, at a share (lanes,), the farthest station
    (lanes,) of the dots within room_px of it, less that room, -inf without one.

    low, high (2,): offset across `toward` and its change per px along it; wide: px between them; skew: px along per px
    across."""
    x, y = toward[0], toward[1]
    quiet[:] = -np.inf
    for n in range(len(dots)):
        station, across = dots[n, 0] * x + dots[n, 1] * y, dots[n, 1] * x - dots[n, 0] * y
        lower, upper = low[0] + low[1] * station, high[0] + high[1] * station
        shares[n] = (across - lower) / max(upper - lower, 1.0)
        along[n] = station - skew * (shares[n] - 0.5) * wide
        for lane in range(len(lanes)):
            if abs(shares[n] - lanes[lane]) * wide < room_px:
                quiet[lane] = max(quiet[lane], along[n])
    for lane in range(len(lanes)):
        quiet[lane] -= room_px


@compiled
def _place(share: float, lanes: int, first_share: float) -> tuple[int, float]:
    """The last lane at or before a share of the way from side to side, of some lanes from first_share to 1 -
    first_share, and how much of the way to the next one it is from there."""
    place = min(max((share - first_share) / (1.0 - 2.0 * first_share), 0.0), 1.0) * (lanes - 1)
    lane = min(int(place), lanes - 2)
    return lane, place - lane


@compiled
def summits_needed(
    along: Floats, shares: Floats, depths: Floats, first_share: float, reach: Floats, strays: int, needed: Floats
) -> None:
    """Where the outermost point of each of k outlines has to be at least (k,) to hold all but some strays of the dots
    at stations along (n,) and shares (n,) of the way from side to side. depths (k, lanes): how far the outlines fall
    behind their outermost points in lanes from first_share to 1 - first_share, in reaches (k,)."""
    most, lane, part = np.empty(strays + 1), np.empty(len(along), np.int64), np.empty(len(along))
    for n in range(len(along)):
        lane[n], part[n] = _place(shares[n], depths.shape[1], first_share)
    for k in range(len(reach)):
        most[:] = -np.inf
        depth = depths[k]
        for n in range(len(along)):
            summit = along[n] + reach[k] * (depth[lane[n]] * (1.0 - part[n]) + depth[lane[n] + 1] * part[n])
            if summit > most[strays]:
                place = strays
                while place > 0 and most[place - 1] < summit:
                    most[place] = most[place - 1]
                    place -= 1
                most[place] = summit
        needed[k] = most[strays]


@compiled
def holes_over(
    absent: Floats, toward: Floats, low: Floats, high: Floats, wide: float, skew: float, depths: Floats,
    first_share: float, reach: Floats, holes: Floats,
) -> int:  # fmt: skip
    """Where the outermost point of each of k outlines lies when it passes through missing dots (m, 2) that are between
    the sides; written to holes (k, m), the first columns; returned: how many. Otherwise as `dots_in_lanes` and
    `summits_needed`."""
    x, y = toward[0], toward[1]
    count = 0
    for m in range(len(absent)):
        station, across = absent[m, 0] * x + absent[m, 1] * y, absent[m, 1] * x - absent[m, 0] * y
        lower, upper = low[0] + low[1] * station, high[0] + high[1] * station
        share = (across - lower) / max(upper - lower, 1.0)
        if not 0.08 < share < 0.92:
            continue
        along = station - skew * (share - 0.5) * wide
        lane, part = _place(share, depths.shape[1], first_share)
        for k in range(len(reach)):
            holes[k, count] = along + reach[k] * (depths[k, lane] * (1.0 - part) + depths[k, lane + 1] * part)
        count += 1
    return count


@compiled
def told_until(stations: Floats, sums: Floats, first: float, step: float, until: Floats) -> None:
    """Add to until (m,) what speaks for a side that goes on to a place, `step` px from place to place from `first` on,
    and no further: sums (n + 1,) up to each of stations (n,) in rising order; nothing without stations."""
    n = 0
    for m in range(len(until)):
        place = first + step * m
        while n < len(stations) and stations[n] < place:
            n += 1
        until[m] += sums[n] if len(stations) else 0.0
