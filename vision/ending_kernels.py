"""Inner loops of a blade's end: which of the shapes, and how far out, explains steps, edges and dots best."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]

SLIGHT = 1e-6  # of evidence: what sums in another order may differ by


@compiled
def likeliest(
    seen: Floats,
    shift: NDArray[np.int64],
    reach: NDArray[np.int64],
    base: Floats,
    weight: Floats,
    arcs: Floats,
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
    below the outermost one, base (k,) evidence beforehand, weight (k,) of the lanes, arcs (k, lanes) how much of it
    each has, first (k,) least place, holes (k, h) places beyond which each missing dot is inside. until (m + lead,):
    evidence of edges that go on to a place and no further, `lead` places ahead of seen's first. last: greatest place.
    Written: places, evidence and shares (k,).
    """
    lanes, count = seen.shape
    lead = len(until) - count
    best = -np.inf
    uncovered = np.zeros(count + 1, np.int64)  # holes that lie inside from each place on
    share, total, value = np.empty(count), np.empty(count), np.empty(count)
    inside, gain, stop = np.empty(count), closed - open_, min(count, last + 1)
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
        rest = 1.0
        for lane in range(lanes):
            if lane % 5 == 4:  # leave out places at both ends that the rest of the lanes could not make the best
                all_but = open_ + gain * rest
                while high > low and total[low] + weight[k] * (all_but + gain * share[low]) <= best - near - SLIGHT:
                    low += 1
                while (
                    high > low
                    and total[high - 1] + weight[k] * (all_but + gain * share[high - 1]) <= best - near - SLIGHT
                ):
                    high -= 1
            start, back, row, arc = max(low, shift[k, lane]), shift[k, lane], seen[lane], arcs[k, lane]
            rest -= arc
            for place in range(start, high):
                share[place] += arc * row[place - back]
        for place in range(low, high):
            value[place] = total[place] + weight[k] * (open_ + gain * share[place])
        for place in range(low, high):
            if value[place] > evidence[k] and total[place] + most > best - near:
                evidence[k], places[k], shares[k] = value[place], place, share[place]
        best = max(best, evidence[k])


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
