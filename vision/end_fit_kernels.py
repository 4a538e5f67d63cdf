"""Inner loops that fit an outline to the steps of lanes across a blade's end."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]

AROUND = 4  # places about an outline in which its steepest place is sought
PASSES = 5  # in which flanks are fitted to the steps next to them
LEAST_FLANK = 4  # lanes that a flank is fitted to
LEAST_LANES, UNREFINED_PX = 6, 4.0  # that another outline is fitted to, and its standard deviation with fewer
AT_APEX = 0.04  # of the width: lanes so near to an apex may belong to either flank
FARTHEST = 0.25  # of the width: what an apex may be off before its flanks are fitted
LEAST_SIGMA_PX = 0.3  # of an apex
TURN_HELD = 0.35  # of a flank's slope: what it may be off
LEAST_SCATTER_PX = 0.7  # of the steepest places about their outline
STRAY_PX = 1.5  # from a shape to the steps that are its outline
MOST_STRAY = 3.0  # square of the farthest, in that unit, at which a lane tells as much as one without a step
LENGTH_HELD = 0.1  # of an outline's reach: what it may be off


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
def _steepest(row: Floats, at: int) -> float:
    """Place, in steps and their parts, of the steepest step within AROUND places of `at`; NaN where that is no step or
    at the verge."""
    last, best, most = len(row) - 2, -1, 0.0
    for m in range(max(at - AROUND, 1), min(at + AROUND, last) + 1):
        if row[m] > most:
            best, most = m, row[m]
    if best < 0 or row[best - 1] > most or row[best + 1] > most:
        return np.nan
    bend = row[best - 1] - 2.0 * most + row[best + 1]
    return best + (0.5 * (row[best - 1] - row[best + 1]) / bend if bend < 0 else 0.0) - 0.5


@compiled
def outline_through(
    size: Floats, at: NDArray[np.int64], top: int, seen: NDArray[np.bool_], shape: Floats, reach: float, step: float
) -> tuple[float, float, float]:
    """How much farther out than place `top` the outermost point of an outline lies, and its standard deviation, in px,
    from the steepest places near the outline, and how ill the shape fits them (half the sum of squares, in units of
    STRAY_PX); robust. With steps in too few lanes it is left where it is.

    size (lanes, m): steps, at places `step` px apart. Of each lane: at, the place of the outline, seen, whether a step
    is there, and shape, how far it lies below the outermost point, in reaches. reach: px.
    """
    lanes = size.shape[0]
    residual, depth = np.empty(lanes), np.empty(lanes)
    n, misfit = 0, 0.0
    for lane in range(lanes):
        if not seen[lane]:
            continue
        place = _steepest(size[lane], at[lane])
        if not np.isfinite(place):
            misfit += 0.5 * MOST_STRAY
            continue
        residual[n], depth[n] = step * (place - top) + reach * shape[lane], shape[lane]
        n += 1
    if n < LEAST_LANES:
        return 0.0, UNREFINED_PX, 0.0
    residual, depth = residual[:n], depth[:n]
    # Outermost point and length of the outline together; the length is held to the shape's own.
    sizes = residual.copy()
    farther, longer, variance = _median(sizes), 0.0, 0.0
    held = 1.0 / max(LENGTH_HELD * reach, 0.1) ** 2
    for _ in range(4):
        for j in range(n):
            sizes[j] = abs(residual[j] - farther + depth[j] * longer)
        scatter = max(LEAST_SCATTER_PX, 1.4826 * _median(sizes))
        a, b, d, x, y = 1e-6, 0.0, held, 0.0, 0.0
        for j in range(n):
            off = (residual[j] - farther + depth[j] * longer) / (2.0 * scatter)
            weight = 1.0 / (1.0 + off * off) ** 2 / scatter**2
            a += weight
            b -= weight * depth[j]
            d += weight * depth[j] * depth[j]
            x += weight * residual[j]
            y -= weight * residual[j] * depth[j]
        determinant = a * d - b * b
        farther, longer = (d * x - b * y) / determinant, (a * y - b * x) / determinant
        variance = d / determinant
    for j in range(n):
        misfit += 0.5 * min(((residual[j] - farther + depth[j] * longer) / STRAY_PX) ** 2, MOST_STRAY)
    return farther, np.hypot(0.5, np.sqrt(3.0 * variance)), misfit


@compiled
def _line_through(x: Floats, y: Floats, fit: Floats, spread: Floats, held: float) -> None:
    """A robust line y = fit[0] + fit[1] x through points (n,) near it, its slope held to `held`; fit (2,) is changed.
    Written: spread (3,), variance of fit[0], covariance, variance of fit[1]."""
    n = len(x)
    sizes = np.empty(n)
    trust = 1.0 / max(TURN_HELD * abs(held), 0.1) ** 2
    for _ in range(3):
        for j in range(n):
            sizes[j] = abs(y[j] - fit[0] - fit[1] * x[j])
        scatter = max(LEAST_SCATTER_PX, 1.4826 * _median(sizes))
        a, b, d, p, q = 1e-6, 0.0, trust, 0.0, trust * held
        for j in range(n):
            off = (y[j] - fit[0] - fit[1] * x[j]) / (2.0 * scatter)
            weight = 1.0 / (1.0 + off * off) ** 2 / scatter**2
            a += weight
            b += weight * x[j]
            d += weight * x[j] * x[j]
            p += weight * y[j]
            q += weight * x[j] * y[j]
        determinant = a * d - b * b
        fit[0], fit[1] = (d * p - b * q) / determinant, (a * q - b * p) / determinant
        spread[0], spread[1], spread[2] = d / determinant, -b / determinant, a / determinant


@compiled
def apex(
    size: Floats, least: float, low: Floats, high: Floats, skew_px: float, shares: Floats, first_px: float, step: float,
    station: float, share: float, reach: float,
) -> tuple[float, float, float, float, float, int]:  # fmt: skip
    """Where the two flanks of a spike meet once each is fitted to its steps: (along, across, standard deviation along,
    where the flanks leave the sides), px, NaN where one of them cannot be fitted; how ill they fit (half the sum of
    squares, in units of STRAY_PX), and in how many lanes.

    size (lanes, m): steps, at least `least` high, at places `step` px apart from first_px on, in lanes as for
    `steps_in_lanes`. station, share, reach: roughly, where the spike ends, on which lane, and how long it is."""
    lanes = size.shape[0]
    across, along, count = np.empty((2, lanes)), np.empty((2, lanes)), np.zeros(2, np.int64)
    fit = np.empty((2, 2))  # along = fit[k, 0] + fit[k, 1] (across - middle), of the lower flank and the upper one
    spread = np.empty((2, 3))
    middle = low[0] + low[1] * station
    wide = high[0] + high[1] * station - middle
    middle += share * wide
    top, foot = station + skew_px * (share - 0.5), station - reach
    for k in range(2):
        side, at = (low, 0.0) if k == 0 else (high, 1.0)
        fit[k, 0] = top
        fit[k, 1] = (foot + skew_px * (at - 0.5) - top) / (side[0] + side[1] * foot - middle)
    held = fit[:, 1].copy()
    meets = 0.0  # from the middle across to where the flanks meet
    for _ in range(PASSES):
        for k in range(2):
            n = 0
            for lane in range(lanes):
                offset = low[0] + shares[lane] * (high[0] - low[0]) - middle
                slope = low[1] + shares[lane] * (high[1] - low[1])
                ahead = skew_px * (shares[lane] - 0.5)
                expected = (fit[k, 0] + fit[k, 1] * offset - ahead) / (1.0 - fit[k, 1] * slope)
                aside = offset + slope * expected - meets
                if (aside > -AT_APEX * wide) if k == 0 else (aside < AT_APEX * wide):
                    continue
                place = (expected - first_px) / step + 0.5
                if not 0 <= place < size.shape[1]:
                    continue
                found = _steepest(size[lane], int(np.rint(place)))
                if not np.isfinite(found) or size[lane, int(found + 0.5)] < 0.5 * least:
                    continue
                seen = first_px + step * found
                across[k, n], along[k, n] = offset + slope * seen, seen + ahead
                n += 1
            if n < LEAST_FLANK:
                return np.nan, np.nan, np.nan, np.nan, np.inf, 0
            count[k] = n
            _line_through(across[k, :n], along[k, :n], fit[k], spread[k], held[k])
        if not fit[0, 1] - fit[1, 1] > 0.2:
            return np.nan, np.nan, np.nan, np.nan, np.inf, 0
        meets = (fit[1, 0] - fit[0, 0]) / (fit[0, 1] - fit[1, 1])
    misfit = 0.0
    for j in range(count[0] + count[1]):
        k = 0 if j < count[0] else 1
        off = (along[k, j - k * count[0]] - fit[k, 0] - fit[k, 1] * across[k, j - k * count[0]]) / STRAY_PX
        misfit += 0.5 * min(off * off, MOST_STRAY)
    ends = fit[0, 0] + fit[0, 1] * meets
    variance, shoulder = 0.0, ends
    for k in range(2):
        part = fit[1 - k, 1] / (fit[0, 1] - fit[1, 1])  # of what this flank is off there, along
        variance += part * part * (spread[k, 0] + 2.0 * meets * spread[k, 1] + meets * meets * spread[k, 2])
        side = low if k == 0 else high
        begin = (fit[k, 0] + fit[k, 1] * (side[0] - middle)) / (1.0 - fit[k, 1] * side[1])
        shoulder = min(shoulder, begin)
    return ends, middle + meets, np.sqrt(variance), shoulder, misfit, count[0] + count[1]


@compiled
def fittest(
    size: Floats, seen: Floats, shift: NDArray[np.int64], depths: Floats, reach: Floats, places: NDArray[np.int64],
    evidences: Floats, pointed: NDArray[np.bool_], least_evidence: float, low: Floats, high: Floats, skew_px: float,
    shares: Floats, first_px: float, step: float, least: float, misfit_weight: float,
) -> tuple[int, float, float, float, float, float]:  # fmt: skip
    """Which of k outlines with more than the least evidence is the likeliest once it is fitted to the steps near it:
    (outline, its outermost point along and across, standard deviation along, where it leaves the sides, evidence).

    size, seen (lanes, m): steps and how much each is one, at stations from first_px on, `step` px apart, in lanes as
    for `steps_in_lanes`; a step is at least `least` high. Of each outline: shift (k, lanes) and places (k,) as for
    `likeliest`, depths (k, lanes), reach (k,) px, pointed (k,): the spikes, of which the likeliest alone is fitted,
    its two flanks freely. misfit_weight: of what a lane tells.
    """
    lanes = size.shape[0]
    at, there = np.empty(lanes, np.int64), np.empty(lanes, np.bool_)
    spike = -1
    for k in range(len(reach)):
        if pointed[k] and (spike < 0 or evidences[k] > evidences[spike]):
            spike = k
    best, best_along, best_across, best_sigma, best_shoulder, most = -1, 0.0, 0.0, 0.0, 0.0, -np.inf
    for k in range(len(reach)):
        if not evidences[k] > least_evidence or (pointed[k] and k != spike):
            continue
        count, lane_share, shallowest = 0, 0.5, np.inf
        for lane in range(lanes):
            at[lane] = places[k] - shift[k, lane]
            there[lane] = at[lane] >= 0 and seen[lane, max(at[lane], 0)] > 0.4
            count += there[lane]
            if reach[k] > 0 and depths[k, lane] < shallowest:
                lane_share, shallowest = shares[lane], depths[k, lane]
        station = first_px + step * places[k]
        wide = high[0] + high[1] * station - low[0] - low[1] * station
        shoulder, met = station - reach[k], False
        if pointed[k]:
            along, across, spread, begin, misfit, used = apex(
                size, least, low, high, skew_px, shares, first_px, step, station, lane_share, reach[k]
            )
            met = abs(along - station) < FARTHEST * wide
            if met:
                shoulder, sigma = begin, np.hypot(LEAST_SIGMA_PX, spread)
                misfit += 0.5 * MOST_STRAY * max(count - used, 0)
        if not met:
            farther, sigma, misfit = outline_through(size, at, places[k], there, depths[k], reach[k], step)
            station += farther
            across = low[0] + low[1] * station
            across += lane_share * (high[0] + high[1] * station - across)
            along = station + skew_px * (lane_share - 0.5)
        evidence = evidences[k] - misfit * misfit_weight
        if evidence >= most:
            best, best_along, best_across, best_sigma, best_shoulder, most = k, along, across, sigma, shoulder, evidence
    return best, best_along, best_across, best_sigma, best_shoulder, most
