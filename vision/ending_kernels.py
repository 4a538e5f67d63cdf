"""Inner loops of a blade's end: which of the shapes, and how far out, explains steps, edges and dots best."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]

AROUND = 4  # places about an outline in which its steepest place is sought
LEAST_SCATTER_PX = 0.7  # of the steepest places about their outline
STRAY_PX = 1.5  # from a shape to the steps that are its outline
SLIGHT = 1e-6  # of evidence: what sums in another order may differ by
LENGTH_HELD = 0.1  # of an outline's reach: what it may be off


@compiled
def likeliest(
    seen: Floats,
    shift: NDArray[np.int64],
    reach: NDArray[np.int64],
    base: Floats,
    weight: Floats,
    first: NDArray[np.int64],
    holes: Floats,
    until: Floats,
    last: int,
    closed: float,
    open_: float,
    hole: float,
    near: float,
    places: NDArray[np.int64],
    evidence: Floats,
    shares: Floats,
) -> None:
    """For each of k shapes its best place, the evidence for it and the share of lanes that close there; evidence is
    -inf where none fits, and may be where it is farther than `near` below a better shape's.

    seen (lanes, m): how much of a step there is at each place. Of k shapes: shift (k, lanes) and reach (k,) in places
    below the outermost one, base (k,) evidence beforehand, weight (k,) of the lanes, first (k,) least place, holes
    (k, h) places beyond which each missing dot is inside. until (m + lead,): evidence of edges that go on
    to a place and no further, `lead` places ahead of seen's first. last: greatest place.
    Written: places, evidence and shares (k,).
    """
    lanes, count = seen.shape
    lead = len(until) - count
    best = -np.inf
    uncovered = np.zeros(count + 1, np.int64)  # holes that lie inside from each place on
    share, total, value = np.empty(count), np.empty(count), np.empty(count)
    inside, gain, stop = np.empty(count), (closed - open_) / lanes, min(count, last + 1)
    for k in range(len(reach)):
        uncovered[:] = 0
        for h in range(holes.shape[1]):
            uncovered[int(min(max(np.floor(holes[k, h]) + 1, 0), count))] += 1
        evidence[k], places[k], shares[k] = -np.inf, -1, 0.0
        # what speaks for each place but for its lanes, and whether these could make it the best
        so_far = 0
        for place in range(stop):
            so_far += uncovered[place]
            inside[place] = so_far
        ahead = lead - reach[k]
        before, own, farther = min(max(-ahead, 0), stop), base[k], until[max(ahead, 0) :]
        for place in range(before):
            total[place] = own + until[0] + hole * inside[place]
        later, inside_later = total[before:], inside[before:]
        for m in range(stop - before):
            later[m] = own + farther[m] + hole * inside_later[m]
        low, high, most = max(first[k], 0), stop, weight[k] * closed
        while low < high and not total[low] + most > best - near:
            low += 1
        while high > low and not total[high - 1] + most > best - near:
            high -= 1
        if high <= low:
            continue
        share[low:high] = 0.0
        for lane in range(lanes):
            if lane % 5 == 4:  # leave out places at both ends that the rest of the lanes could not make the best
                all_but = open_ + (closed - open_) * (lanes - lane) / lanes
                while high > low and total[low] + weight[k] * (all_but + gain * share[low]) <= best - near - SLIGHT:
                    low += 1
                while (
                    high > low
                    and total[high - 1] + weight[k] * (all_but + gain * share[high - 1]) <= best - near - SLIGHT
                ):
                    high -= 1
            start, back, row = max(low, shift[k, lane]), shift[k, lane], seen[lane]
            for place in range(start, high):
                share[place] += row[place - back]
        for place in range(low, high):
            value[place] = total[place] + weight[k] * (open_ + (closed - open_) * (share[place] / lanes))
        for place in range(low, high):
            if value[place] > evidence[k] and total[place] + most > best - near:
                evidence[k], places[k], shares[k] = value[place], place, share[place] / lanes
        best = max(best, evidence[k])


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
def outline_through(
    size: Floats, at: NDArray[np.int64], top: int, seen: NDArray[np.bool_], shape: Floats, reach: float, step: float
) -> tuple[float, float, float]:
    """How much farther out than place `top` the outermost point of an outline lies, and its standard deviation, in px,
    from the steepest places near the outline, and how ill the shape fits them (half the sum of squares, in units of
    STRAY_PX); robust. Some lane has to be seen.

    size (lanes, m): steps, at places `step` px apart. Of each lane: at, the place of the outline, seen, whether a step
    is there, and shape, how far it lies below the outermost point, in reaches. reach: px.
    """
    lanes, last = size.shape[0], size.shape[1] - 1
    residual, depth = np.empty(lanes), np.empty(lanes)
    n = 0
    for lane in range(lanes):
        if not seen[lane]:
            continue
        best = -AROUND
        for i in range(1 - AROUND, AROUND + 1):
            if size[lane, min(max(at[lane] + i, 0), last)] > size[lane, min(max(at[lane] + best, 0), last)]:
                best = i
        here = at[lane] + min(max(best, 1 - AROUND), AROUND - 1)
        place = min(max(here, 0), last)
        before, peak = size[lane, min(max(here - 1, 0), last)], size[lane, place]
        after = size[lane, min(max(here + 1, 0), last)]
        bend = before - 2.0 * peak + after
        fraction = min(max(0.5 * (before - after) / bend, -0.5), 0.5) if bend < 0 else 0.0
        residual[n] = step * (place - top + fraction - 0.5) + reach * shape[lane]
        depth[n] = shape[lane]
        n += 1
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
    misfit = 0.0
    for j in range(n):
        misfit += 0.5 * min(((residual[j] - farther + depth[j] * longer) / STRAY_PX) ** 2, 9.0)
    return farther, np.sqrt(3.0 * variance), misfit


@compiled
def fittest(
    size: Floats, seen: Floats, shift: NDArray[np.int64], depths: Floats, reach: Floats, places: NDArray[np.int64],
    evidences: Floats, least_evidence: float, least_lanes: int, unrefined_px: float, first_px: float, step: float,
    misfit_weight: float,
) -> tuple[int, float, float, float]:  # fmt: skip
    """Which of k outlines with more than the least evidence is the likeliest once it is fitted to the steps near it:
    (outline, station of its outermost point, standard deviation in px, evidence).

    size, seen (lanes, m): steps and how much each is one, at stations from first_px on, `step` px apart. Of each
    outline: shift (k, lanes) and places (k,) as for `likeliest`, depths (k, lanes) and reach (k,) px. With fewer than
    least_lanes it is left where it is, with the standard deviation unrefined_px. misfit_weight: of what a lane tells.
    """
    lanes = size.shape[0]
    at, there = np.empty(lanes, np.int64), np.empty(lanes, np.bool_)
    best, best_station, best_sigma, most = -1, 0.0, 0.0, -np.inf
    for k in range(len(reach)):
        if not evidences[k] > least_evidence:
            continue
        count = 0
        for lane in range(lanes):
            at[lane] = places[k] - shift[k, lane]
            there[lane] = at[lane] >= 0 and seen[lane, max(at[lane], 0)] > 0.4
            count += there[lane]
        station, sigma, misfit = first_px + step * places[k], unrefined_px, 0.0
        if count >= least_lanes:
            farther, spread, misfit = outline_through(size, at, places[k], there, depths[k], reach[k], step)
            station, sigma = station + farther, np.sqrt(0.25 + spread * spread)
        evidence = evidences[k] - misfit * misfit_weight
        if evidence >= most:
            best, best_station, best_sigma, most = k, station, sigma, evidence
    return best, best_station, best_sigma, most


@compiled
def seen_along(
    t: Floats, agrees: NDArray[np.bool_], start: float, rate: float, seen: float, unseen: float, stations: Floats,
    evidence: Floats, sums: Floats,
) -> float:  # fmt: skip
    """An edge's places t (m,) as stations (m,) = start + rate · t in rising order, what each says for the edge,
    evidence (m,), as its step agrees or not, and the sums (m + 1,) of that up to each; returned: the greatest sum."""
    count, most = len(t), 0.0
    sums[0] = 0.0
    for m in range(count):
        k = m if rate * (t[count - 1] - t[0]) >= 0 else count - 1 - m
        stations[m] = start + rate * t[k]
        evidence[m] = seen if agrees[k] else unseen
        sums[m + 1] = sums[m] + evidence[m]
        most = max(most, sums[m + 1])
    return most
