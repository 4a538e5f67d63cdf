"""Inner loop of a blade's end: which of the shapes, and how far out, explains steps, edges and dots best."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]


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
) -> tuple[int, int, float, float]:
    """The best shape and place (shape, place, evidence, share of lanes that close); shape -1 where none fits.

    seen (lanes, m): how much of a step there is at each place. Of k shapes: shift (k, lanes) and reach (k,) in places
    below the outermost one, base (k,) evidence beforehand, weight (k,) of the lanes, first (k,) least place, holes
    (k, h) places, ascending, beyond which each missing dot is inside. until (m + lead,): evidence of edges that go on
    to a place and no further, `lead` places ahead of seen's first. last: greatest place.
    """
    lanes, count = seen.shape
    lead = len(until) - count
    best, best_shape, best_place, best_share = -np.inf, -1, -1, 0.0
    for k in range(len(reach)):
        inside = 0
        for place in range(max(first[k], 0), min(last + 1, count)):
            while inside < holes.shape[1] and holes[k, inside] < place:
                inside += 1
            at_shoulder = min(max(place - reach[k] + lead, 0), len(until) - 1)
            total = base[k] + until[at_shoulder] + hole * inside
            if total + weight[k] * closed <= best:
                continue
            share = 0.0
            for lane in range(lanes):
                at = place - shift[k, lane]
                if at >= 0:
                    share += seen[lane, at]
            share /= lanes
            total += weight[k] * (open_ + (closed - open_) * share)
            if total > best:
                best, best_shape, best_place, best_share = total, k, place, share
    return best_shape, best_place, best, best_share
