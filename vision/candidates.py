"""Weighs lines as edges of the blade: what speaks for each, from its steps, the dots beside it and the other eye."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.beside_kernels import shares_beyond
from vision.capture import Image
from vision.evidence import (
    Blade,
    OtherEye,
    beside,
    blocked,
    missing,
    nearer_lines,
    parallax,
    runs,
    runs_at_focus,
    support_within,
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
    normal = np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    rho = np.ascontiguousarray(lines[:, 1])
    inside, outside = shares_beyond(dots, -normal, -rho, -7.0), shares_beyond(dots, normal, rho, -7.0)
    flip = outside > inside
    keep = np.maximum(inside, outside) > 0.99 - blade.strays
    normal[flip], rho = -normal[flip], np.where(flip, -rho, rho)
    normal, rho = normal[keep][:CANDIDATES], rho[keep][:CANDIDATES]
    if len(rho) == 0:
        return []
    rough = _promising(normal, rho, blade, smooth, noise)
    seen = rough[0]
    if len(seen.rho) == 0:
        return []
    steps = typical_step(seen, seen.agrees)
    nearer = nearer_lines(seen, blade, smooth, steps, rough[1], rough[2], noise)
    passes = [rough, _promising(*nearer, blade, smooth, noise)] if len(nearer[1]) else [rough]
    normal, rho = np.vstack([one[0].normal for one in passes]), np.concatenate([one[0].rho for one in passes])
    start, stop = np.concatenate([one[1] for one in passes]), np.concatenate([one[2] for one in passes])
    profile = refine_lines(smooth, normal, rho, noise, np.clip(0.0, start, stop), 4, 0.6, LAST_SAMPLES)
    crossed = shares_beyond(dots, profile.normal, profile.rho, 2.5)
    low, high = beside(dots, profile.normal)
    support = support_within(profile, low, high)
    first, last = runs(profile)
    which = np.flatnonzero((crossed <= blade.strays) & ((support >= LEAST_SUPPORT) | (last - first > LEAST_RUN)))
    if len(which) == 0:
        return []
    profile = profile.take(which)
    found = _weighed(profile, blade, smooth, noise, other, low[which], high[which])
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
    profile = refine_lines(smooth, normal, rho, noise, np.clip(0.0, low, high), 8, 2.4, 40)
    low, high = beside(dots, profile.normal)
    support = support_within(profile, low, high)
    first, last = runs(profile)
    which = (support > 0.6 * LEAST_SUPPORT) | (last - first > LEAST_RUN)
    which &= shares_beyond(dots, profile.normal, profile.rho, 5.0) < 0.2
    overlap = np.minimum(high, last) - np.maximum(low, first) > LEAST_RUN
    start, stop = np.where(overlap, np.maximum(low, first), first), np.where(overlap, np.minimum(high, last), last)
    start, stop = np.where(support > LEAST_SUPPORT, low, start), np.where(support > LEAST_SUPPORT, high, stop)
    chosen = np.flatnonzero(which)
    return profile.take(chosen), start[chosen], stop[chosen]


def _weighed(
    profile: Profiles, blade: Blade, smooth: Image, noise: float, other: OtherEye | None, low: Array, high: Array
) -> list[Candidate]:
    dots = blade.dots
    crossed = shares_beyond(dots, profile.normal, profile.rho, 2.5)
    support = support_within(profile, low, high)
    first, last = runs_at_focus(profile)
    on_run = (profile.t >= first[:, None] - 1) & (profile.t <= last[:, None] + 1)
    step = typical_step(profile, on_run)
    told = np.full(len(crossed), np.nan)
    if other is not None:
        told = parallax(profile, other, on_run, noise)
    before = blocked(profile, blade, smooth, step, low, high, noise)
    start, stop = np.maximum(low, first), np.minimum(high, last)
    apart = stop - start < LEAST_RUN
    start, stop = np.where(apart, first, start), np.where(apart, last, stop)
    before_run = blocked(profile, blade, smooth, step, start, stop, noise)
    empty, beyond = missing(blade, profile, low, high)
    empty_run, beyond_run = missing(blade, profile, start, stop)
    likely = (before < 0.5) & ~(told < 0.4) & (empty < 0.3) & (support >= LEAST_SUPPORT)
    strongest = max(float(np.max(np.where(likely, step, 0))), 1.0)

    clear = 0.35 * np.clip(np.log2(np.maximum(step, 1e-9) / strongest), -3.0, 0.5)
    clear += 0.35 * np.clip(np.log2(np.maximum(step, 1e-9) / max(blade.texture, 1.0)), -2.0, 1.0)
    clear += np.where(np.isnan(told), 0.2, np.where(told > 0.5, 0.6 * told, -7.0 * (0.5 - told))) - 5.0 * crossed

    # What lies before a step at the blade's own depth, with no dots missing up to it, is a seam or a shadow.
    behind = 1.0 - np.clip(np.nan_to_num(told - 0.5) / 0.4, 0.0, 1.0)

    def sums(hidden: Array, empty: Array, beyond: Array) -> Array:
        hidden = hidden * np.where(empty < FEW_MISSING, behind, 1.0)
        against = 2.0 * hidden + 3.0 * np.maximum(hidden - 0.5, 0.0) + (5.0 if blade.grid_known else 2.5) * empty
        return np.asarray(clear - against + 0.15 * np.minimum(beyond, 6))

    least = np.where((beyond > 0) & (empty == 0), LEAST_SEEN, LEAST_SUPPORT)
    value = np.where(support >= least, 2.0 * support + sums(before, empty, beyond), -np.inf)
    worth = sums(before_run, empty_run, beyond_run)
    return [
        Candidate(
            profile.normal[k],
            float(profile.rho[k]),
            float(support[k]),
            float(told[k]),
            float(step[k]),
            float(before[k]),
            float(empty[k]),
            int(beyond[k]),
            (float(first[k]), float(last[k])),
            float(value[k]),
            float(worth[k]),
            profile,
            k,
        )
        for k in range(len(crossed))
    ]
