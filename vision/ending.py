"""The end of a blade: two edges closed by a round, square or spiked outline, fitted as one shape in lanes along the
axis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate
from vision.capture import Image
from vision.end_fit_kernels import fittest
from vision.ending_kernels import likeliest, seen_along
from vision.evidence import Blade
from vision.lane_kernels import seen_in_lanes, steps_in_lanes
from vision.lines import visible_stretch
from vision.outline_kernels import dots_in_lanes, holes_over, summits_needed, told_until

Array = NDArray[Any]  # of floats

LANES = 25  # across the blade, from edge to edge
FIRST_SHARE = 0.05  # of the width, from the edge to the first lane
STEP = 1.5  # px along a lane
SLACK = 4  # samples by which an outline may miss the steps before it is fitted to them
BOX, LONG_BOX = 4, 14  # samples averaged on either side of a step, and on either side to tell it from a streak
NO_STREAK = (0.4, 0.6)  # of a step, and of the least one, that the longer samples have to show as well
CORRELATED_PX = 8.0  # so far along an outline its steps tell the same
SEEN, UNSEEN = 1.28, -2.0  # log of how much likelier an outline is to show a step, or none, than other places are
CLOSED, OPEN = 1.4, -1.6  # the same where a lane ends
CLEAR = 5.0  # evidence by which a blade that ends must be likelier than one that goes on
LEAST_SHARE = 0.5  # of the lanes that close
HOLE = -3.5  # of a missing dot inside the outline
LEAST_GONE = 2  # missing dots beyond an end of a blade of which one edge is not seen
DOT_AHEAD_PX = 4.0  # px: so near a lane a dot is its own, and it does not end before it by more
DOT_ROOM = 3.0  # px: a dot's centre may lie so far beyond the outline
RIVAL = 25.0  # evidence within which the shapes are told apart by how well they fit
APART_PX = 4.0  # so far apart lanes tell different things of the shape
NARROWEST = 16.0  # px
HIDDEN_PX = 9.0  # a step so far before the outline hides it
SUMMITS = (0.0, -0.1, 0.1, -0.3, 0.3, -0.6, 0.6)  # of an outline, from the middle toward an edge
LOPSIDED = -8.0  # evidence of an outline whose summit is all the way to one side
BORDER = 6.0  # px: an outline nearer to the image border than this is not seen to close
SHARES = np.linspace(FIRST_SHARE, 1 - FIRST_SHARE, LANES)  # where lanes lie, 0 on the lower edge and 1 on the upper


def _shapes() -> tuple[Array, Array]:
    """Lengths (k,) in widths of the blade and depths (k, LANES) below the outermost point, in lengths, of outlines."""
    x = 2 * SHARES - 1
    found: list[tuple[float, Array]] = [(0.0, np.zeros(LANES))]
    for summit in SUMMITS:
        apart = np.where(x < summit, (summit - x) / (1 + summit), (x - summit) / (1 - summit))
        found += [(length, 1 - np.sqrt(1 - apart**2)) for length in (0.2, 0.32, 0.45, 0.6, 0.8)]
        found += [(length, apart) for length in (0.4, 0.5, 0.6, 0.7, 0.8, 0.92, 1.05)]
    return np.array([length for length, _ in found]), np.array([depth for _, depth in found])


LENGTHS, DEPTHS = _shapes()
POINTED = DEPTHS.sum(axis=1) > 0.42 * LANES  # of the outlines, the spikes
ARCS = np.hypot(1.0, LENGTHS[:, None] * np.gradient(DEPTHS, SHARES, axis=1))  # of each outline, in widths, by lanes
OUTLINES = ARCS.mean(axis=1)  # length of each outline, in widths of the blade
ARCS /= ARCS.sum(axis=1, keepdims=True)
LONGEST_OUTLINE = float(OUTLINES.max())
PRIORS = LOPSIDED * np.abs(2 * SHARES[DEPTHS.argmin(axis=1)] - 1) * (LENGTHS > 0)


@dataclass(frozen=True)
class Side:
    """An edge of the blade seen along an axis: offset across it is `offset + slope · station`. evidence: places along
    the axis (m,) and what each says for an edge there (m,), none for a side that no edge was seen of; sums (m + 1,):
    of the evidence up to each, and most: the most that can speak for an edge that ends somewhere."""

    offset: float
    slope: float
    stations: Array
    evidence: Array
    sums: Array
    most: float

    def at(self, station: Array | float) -> Array:
        """Offset across the axis at stations."""
        return np.asarray(self.offset + self.slope * np.asarray(station, float))


def side_of(edge: Candidate, toward: Array) -> Side:
    """An edge as seen along a direction (2,)."""
    profile, k = edge.profile, edge.index
    t = profile.t[k]
    (x, y), (out_x, out_y), (along_x, along_y) = toward.tolist(), edge.outward.tolist(), profile.direction[k].tolist()
    slope, lean = out_y * x - out_x * y, out_x * x + out_y * y
    length = abs(float(t[1] - t[0])) / CORRELATED_PX
    stations, evidence, sums = np.empty(len(t)), np.empty(len(t)), np.empty(len(t) + 1)
    rate = along_x * x + along_y * y
    agrees = profile.agrees[k]
    most = seen_along(t, agrees, edge.rho * lean, rate, SEEN * length, UNSEEN * length, stations, evidence, sums)
    return Side(edge.rho / slope, -lean / slope, stations, evidence, sums, most)


def side_beside(dots: Array, toward: Array, sign: float, slope: float) -> Side:
    """A side that no edge was seen of: just past the dots that lie outermost across the axis."""
    across = np.array([-toward[1], toward[0]])
    reach = dots @ across - slope * (dots @ toward)
    offset = float(reach.max()) + 8.0 if sign > 0 else float(reach.min()) - 8.0
    return Side(offset, slope, np.zeros(0), np.zeros(0), np.zeros(1), 0.0)


@dataclass(frozen=True)
class Ending:
    """How a blade between two sides may end. toward (2,): along the axis; station and lane: the outermost point on
    it, px; shoulder: where the edges end; share: of the lanes in which a step is seen; evidence: for the blade with
    this end; goes_on: for the blade that leaves the image."""

    toward: Array
    station: float
    lane: float
    shoulder: float
    share: float
    sigma_px: float
    evidence: float
    goes_on: float


def fit_ending(
    smooth: Image,
    noise: float,
    sides: tuple[Side, Side],
    toward: Array,
    blade: Blade,
    usual: float,
    least_evidence: float = -np.inf,
) -> Ending | None:
    """The likeliest end of the blade between its lower and upper side along `toward` (2,), None where none can be, or
    none with more evidence than the least that is of use.

    usual: the height of the edges' steps in grey levels.
    """
    low, high = sides
    height, width = smooth.shape[:2]
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    along = blade.dots @ toward
    last_dot = float(along.max())
    upper_edge, lower_edge = high.offset + high.slope * last_dot, low.offset + low.slope * last_dot
    wide, middle = upper_edge - lower_edge, (upper_edge + lower_edge) / 2
    if wide < NARROWEST or low.most + high.most + CLOSED * wide * LONGEST_OUTLINE / CORRELATED_PX <= least_evidence:
        return None
    across = np.array([-toward[1], toward[0]])
    start, stop = visible_stretch(across[None], np.array([middle]), centre - 2)
    sign = 1.0 if np.array([-across[1], across[0]]) @ toward > 0 else -1.0
    border = float((stop if sign > 0 else -start)[0])
    first = last_dot - 1.3 * wide - LONG_BOX * STEP
    far = min(border, last_dot + 1.3 * wide + 60)
    s = np.arange(first, far, STEP)
    if len(s) < 4 * LONG_BOX:
        return None
    skew = blade.skew(last_dot * toward + middle * across, toward)
    # A lane may not end before the dots it carries.
    lower, upper = (np.array([side.offset, side.slope]) for side in sides)
    share_of, quiet = np.empty(len(along)), np.empty(LANES)
    dots_in_lanes(blade.dots, toward, lower, upper, wide, skew, SHARES, DOT_AHEAD_PX, share_of, along, quiet)
    faintest = max(3.0, 1.5 * noise)
    weakest = max(faintest, 0.9 * blade.texture)
    size, seen = np.empty((2, LANES, len(s)))
    boxes = (BOX, LONG_BOX)
    found = None
    for least in sorted({max(weakest, 0.2 * usual), weakest, faintest}, reverse=True):
        steps_in_lanes(smooth, lower, upper, toward, skew * wide, SHARES, s, quiet, boxes, NO_STREAK, least, size)
        seen_in_lanes(size, least, int(HIDDEN_PX / STEP), SLACK, seen)
        found = _best(s, seen, size, sides, toward, blade, share_of, along, border, wide, skew, least)
        # Where dots tell that the blade ends, its end may show less than its edges and its own shade do.
        if found is None or found.share >= LEAST_SHARE or found.evidence < found.goes_on + CLEAR:
            break
    return found


def _best(
    s: Array,
    seen: Array,
    size: Array,
    sides: tuple[Side, Side],
    toward: Array,
    blade: Blade,
    share_of: Array,
    along: Array,
    border: float,
    wide: float,
    skew: float,
    least_step: float,
) -> Ending | None:
    low, high = sides
    lower, upper = (np.array([side.offset, side.slope]) for side in sides)
    reach, start = LENGTHS * wide, float(s[0])
    # Dots that the outline has to hold, and missing ones that it should not.
    strays = int(blade.strays * len(along) + 0.9) if len(along) >= 20 else 0
    needed, holes = np.empty(len(reach)), np.empty((len(reach), len(blade.absent)))
    summits_needed(along, share_of, DEPTHS, FIRST_SHARE, reach, strays, needed)
    gone = holes_over(blade.absent, toward, lower, upper, wide, skew, DEPTHS, FIRST_SHARE, reach, holes)
    if gone < LEAST_GONE and not (len(low.stations) and len(high.stations)):
        return None
    hole = HOLE if blade.grid_known else HOLE / 2
    shift = np.rint(DEPTHS * reach[:, None] / STEP).astype(np.int64)
    lead = int(shift.max()) + 1
    until = np.zeros(len(s) + lead)
    for side in sides:
        told_until(side.stations, side.sums, start - STEP * lead, STEP, until)
    count = len(LENGTHS)
    places, evidences, closing = np.empty(count, np.int64), np.empty(count), np.empty(count)
    weights = wide * OUTLINES / CORRELATED_PX  # independent places along each outline
    likeliest(
        seen, shift, np.rint(reach / STEP).astype(np.int64), PRIORS, weights, ARCS,
        np.ceil((needed - DOT_ROOM - start) / STEP).astype(np.int64), (holes[:, :gone] + DOT_ROOM - start) / STEP,
        until, int((border - BORDER - start) / STEP), CLOSED, OPEN, hole, RIVAL, places, evidences, closing,
    )  # fmt: skip
    best = float(evidences.max())
    if not np.isfinite(best):
        return None
    goes_on = float(low.sums[-1] + high.sums[-1]) + hole * gone
    least, tells = best - RIVAL, min(1.0, wide / LANES / APART_PX)
    k, station, lane, sigma, shoulder, evidence = fittest(
        size, seen, shift, DEPTHS, reach, places, evidences, POINTED, least, lower, upper, skew * wide, SHARES, start,
        STEP, least_step, tells,
    )  # fmt: skip
    return Ending(toward, station, lane, shoulder, float(closing[k]), sigma, evidence, goes_on)
