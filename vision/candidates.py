"""Weighs lines as edges of the blade: what speaks for each, from its steps, the dots beside it and the other eye."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, log2, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.beside_kernels import facing
from vision.capture import Image
from vision.evidence import (
    Blade,
    OtherEye,
    beside,
    blocked,
    missing,
    nearer_lines,
    parallax,
    runs_at_focus,
    seen_before,
    told_by_dots,
    typical_step,
)
from vision.lines import Profiles, refine_lines

Array = NDArray[Any]  # of floats

CANDIDATES = 40
LAST_SAMPLES = 84  # profiles along a line when it is measured for good
LEAST_SUPPORT = 0.5
LEAST_SEEN = 0.38  # the same of a line beyond which dots are missing and before which none are
FOLLOWED_PX = 25.0  # of a step that a line follows, worth as much as one unit of what else speaks for it
ALIKE = cos(radians(4.0))  # of the angle between lines that may be one
MOST_BEFORE = 2  # dots of the background before a line: with so many it is not the blade's
FEW_BEYOND = 3  # missing dots past a line that tell that the blade ends there
PLAIN = 2.5  # times the blade's own texture: a step that needs no other witness to be an edge
FEW_MISSING = 0.05  # of the dots up to a line: so many are overlooked
LEAST_RUN = 50.0  # px: a shorter stretch of an edge with no dots beside it is none


@dataclass(frozen=True, eq=False)
class Candidate:
    """A refined line with its outward normal and offset (image frame, working px) and what speaks for it.

    support: share of the stretch beside the dots on which there is a step. parallax: share of that which the other
    eye sees at the blade's depth. step: its height in grey levels. blocked: share of that stretch on which a step as
    strong lies between dots and line. empty: share of the dots expected up to the line that are missing. beyond:
    missing ones past the line.
    ends: places between which the step goes on, along the direction `profile.direction[index]`.
    value: what speaks for it as an edge of a blade that goes on through the image; -inf where too little support.
    worth: what else than its extent speaks for the stretch on which its step goes on.
    """

    outward: Array
    rho: float
    support: float
    parallax: float
    step: float
    blocked: float
    empty: float
    beyond: int
    ends: tuple[float, float]
    value: float
    worth: float
    profile: Profiles
    index: int


def weigh(lines: Array, blade: Blade, smooth: Image, noise: float, other: OtherEye | None) -> list[Candidate]:
    """Candidates out of lines (k, 2) of (theta, signed rho), refined, with what speaks for them."""
    dots = blade.dots
    normal, rho = np.empty((CANDIDATES, 2)), np.empty(CANDIDATES)
    count = facing(np.ascontiguousarray(lines), dots, -7.0, 0.99 - blade.strays, normal, rho)
    if count == 0:
        return []
    rough = _promising(normal[:count], rho[:count], blade, smooth, noise)
    seen, start, stop = rough
    if len(seen.rho) == 0:
        return []
    normal, rho = seen.normal, seen.rho
    nearer = nearer_lines(seen, blade, smooth, typical_step(seen, seen.agrees), start, stop, noise)
    if len(nearer[1]):
        more, more_start, more_stop = _promising(*nearer, blade, smooth, noise)
        normal, rho = np.concatenate((normal, more.normal)), np.concatenate((rho, more.rho))
        start, stop = np.concatenate((start, more_start)), np.concatenate((stop, more_stop))
    profile = refine_lines(smooth, normal, rho, noise, _nearest_to_middle(start, stop), 4, 0.6, LAST_SAMPLES)
    told = told_by_dots(profile, dots, 2.5)
    crossed, _, _, support, first, last = told
    which = np.flatnonzero((crossed <= blade.strays) & ((support >= LEAST_SUPPORT) | (last - first > LEAST_RUN)))
    if len(which) == 0:
        return []
    found = _weighed(profile.take(which), blade, smooth, noise, other, told[:4, which])
    # Of fits to one step that which follows more of it is right: a line that starts askew may lose half of it.
    found.sort(key=lambda c: -c.worth - _followed(c) / FOLLOWED_PX)
    ways = [c.outward.tolist() for c in found]
    found = [
        one
        for k, (one, (x, y)) in enumerate(zip(found, ways, strict=True))
        if not any(x * ways[b][0] + y * ways[b][1] >= ALIKE and _same(one, found[b]) for b in range(k))
    ]
    return sorted(found, key=lambda c: -c.worth)


def _followed(one: Candidate) -> float:
    """Along how many px of it the line follows its step."""
    t = one.profile.t[one.index]
    return float(one.profile.agrees[one.index].sum()) * float(t[1] - t[0])


def _same(one: Candidate, other: Candidate) -> bool:
    """Whether two candidates that run alike are the same step: their lines agree where either of them is seen."""
    middle = one.outward * one.rho + sum(one.ends) / 2 * one.profile.direction[one.index]
    theirs = other.outward * other.rho + sum(other.ends) / 2 * other.profile.direction[other.index]
    return abs(float(other.outward @ middle) - other.rho) < 3.0 and abs(float(one.outward @ theirs) - one.rho) < 3.0


def _promising(normal: Array, rho: Array, blade: Blade, smooth: Image, noise: float) -> tuple[Profiles, Array, Array]:
    """Lines refined for the first time, those that may be edges, and the stretch of each (low, high) (k,) that has both
    dots beside it and a step, or a step where none does."""
    dots = blade.dots
    low, high = beside(dots, normal)
    profile = refine_lines(smooth, normal, rho, noise, _nearest_to_middle(low, high), 8, 2.4, 40)
    crossed, low, high, support, first, last = told_by_dots(profile, dots, 5.0)
    which = (support > 0.6 * LEAST_SUPPORT) | (last - first > LEAST_RUN)
    which &= crossed < 0.2
    overlap = np.minimum(high, last) - np.maximum(low, first) > LEAST_RUN
    start, stop = np.where(overlap, np.maximum(low, first), first), np.where(overlap, np.minimum(high, last), last)
    start, stop = np.where(support > LEAST_SUPPORT, low, start), np.where(support > LEAST_SUPPORT, high, stop)
    chosen = np.flatnonzero(which)
    return profile.take(chosen), start[chosen], stop[chosen]


def _nearest_to_middle(start: Array, stop: Array) -> Array:
    """The places (k,) between starts and stops that are nearest to the foot of the image centre."""
    return np.asarray(np.minimum(np.maximum(0.0, start), stop))


def _weighed(
    profile: Profiles, blade: Blade, smooth: Image, noise: float, other: OtherEye | None, told_by_dots: Array
) -> list[Candidate]:
    """What speaks for each of k lines; told_by_dots (4, k): of what dots tell, the share of them past it, the stretch
    (low, high) beside them, and the support there."""
    low, high = told_by_dots[1], told_by_dots[2]
    first, last = runs_at_focus(profile)
    on_run = (profile.t >= first[:, None] - 1) & (profile.t <= last[:, None] + 1)
    steps = typical_step(profile, on_run)
    shown = np.full(len(low), np.nan) if other is None else parallax(profile, other, on_run, noise)
    before = blocked(profile, blade, smooth, steps, low, high, noise)
    start, stop = np.maximum(low, first), np.minimum(high, last)
    apart = stop - start < LEAST_RUN
    start, stop = np.where(apart, first, start), np.where(apart, last, stop)
    gone = missing(blade, profile, low, high)
    before_run, gone_on_run = before, gone
    if (start != low).any() or (stop != high).any():
        before_run = blocked(profile, blade, smooth, steps, start, stop, noise)
        gone_on_run = missing(blade, profile, start, stop)
    known = (*told_by_dots, steps, shown, before, *gone, before_run, *gone_on_run, first, last, profile.rho)
    bounds = seen_before(blade, profile, start, stop) < MOST_BEFORE
    rows = np.stack(known).T.tolist()
    strongest = 1.0
    for _, _, _, support, step, told, hidden, empty, *_ in rows:
        if hidden < 0.5 and not told < 0.4 and empty < 0.3 and support >= LEAST_SUPPORT:
            strongest = max(strongest, step)
    found = []
    for k in np.flatnonzero(bounds).tolist():
        row = rows[k]
        crossed, _, _, support, step, told, hidden, empty, beyond, hidden_run, empty_run, beyond_run, *_, rho = row
        clear = 0.35 * min(max(log2(max(step, 1e-9) / strongest), -3.0), 0.5)
        clear += 0.35 * min(max(log2(max(step, 1e-9) / max(blade.texture, 1.0)), -2.0), 1.0)
        clear += 0.2 if told != told else 0.6 * told if told > 0.5 else -7.0 * (0.5 - told)
        clear -= 5.0 * crossed
        # What lies before a clear step at the blade's own depth, with no dots missing up to it, is a seam or a shadow.
        sure = told == told and (step > PLAIN * blade.texture or beyond_run >= FEW_BEYOND)
        behind = 1.0 - min(max((told - 0.5) / 0.4, 0.0), 1.0) if sure else 1.0
        per_missing = 5.0 if blade.grid_known else 2.5
        value, worth = (
            clear - _against(seen * behind if lost < FEW_MISSING else seen, per_missing * lost, past)
            for seen, lost, past in ((hidden, empty, beyond), (hidden_run, empty_run, beyond_run))
        )
        enough = support >= (LEAST_SEEN if beyond > 0 and empty == 0 else LEAST_SUPPORT)
        value = 2.0 * support + value if enough else float("-inf")
        ends = (row[12], row[13])
        found.append(
            Candidate(
                profile.normal[k], rho, support, told, step, hidden, empty, int(beyond), ends, value, worth, profile, k
            )
        )
    return found


def _against(hidden: float, missing_dots: float, beyond: float) -> float:
    """What speaks against a line of which a share is hidden, missing dots up to it, and for it as many beyond."""
    return 2.0 * hidden + 3.0 * max(hidden - 0.5, 0.0) + missing_dots - 0.15 * min(beyond, 6.0)
