"""Finds the blade's edges: lines with every dot of the blade on one side, unbroken beside those dots, at the blade's
depth.

A line of the background (horizon, tower, another blade, a cable) ends where the blade hides it, lies behind a stronger
step, has another parallax than the blade, or leaves room on the blade where dots ought to be; a seam or a streak on the
blade has dots on both sides or a weaker step than the edge. The edges of one blade are nearly parallel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import LEAST_RUN, LEAST_SUPPORT, PLAIN, Candidate, weigh
from vision.capture import Image
from vision.closing import contradicted, evidence_of, find_closed, goes_on, opposite, seen_on, unexplained, with_partner
from vision.continued import continues
from vision.edge_fit import lens_bend, settled, trimmed
from vision.ending import Ending
from vision.evidence import Blade, OtherEye
from vision.lines import hough_lines, sensor_noise
from vision.observation import Edge, Line
from vision.unwitnessed import MOST_EMPTY, like_an_edge, typical_edge

Array = NDArray[Any]  # of floats

FROM_EXPECTED = np.deg2rad(28)  # half the taper, the root's flare, perspective, and what the expectation may be off
LARGEST_TAPER = np.deg2rad(16)
LARGEST_FLARE = np.deg2rad(28)  # of the root; so much is believed only where the axis is known
LEAST_VALUE = 1.2
MOST_MISSING = 0.35  # of the dots within the edges, beyond which they are not believed
NOT_THERE = 0.25  # of a step that the other eye sees at the blade's depth: with less it is behind the blade
LEAST_GONE = 3  # missing dots between two steps that tell which of them is the edge
BEHIND_SHOULDER = 12.0  # px: so far behind it an end no longer bends the edges
SHORT = 100.0  # px: an edge that is seen no farther may be bent by the end that it is seen before
UNSURE, SHORT_UNSURE = np.deg2rad(1.0), np.deg2rad(0.5)  # standard deviations of direction, from which none is told
LEVEL_ALONG, LEVEL_OUT = 1.2, 0.25  # of the dots' spacing: how far along and inward of a gap a dot is level with it
OUTSHINES = 3.0  # times another step
SEEN_ON = 0.01  # of one unit of a candidate's value, what one of evidence along all of it is worth
SECOND_EDGE = 2.2  # how much less than the better edge the other one may be worth


@dataclass(frozen=True)
class Found:
    """The blade's edges (none, one or two), the direction of its axis modulo π, NaN where nothing gives it, how it
    ends if it ends in the image, and reasons where there is no edge."""

    edges: tuple[Candidate, ...]
    axis: float
    ending: Ending | None
    reasons: tuple[str, ...]


def find_edges(
    tones: Image, smooth: Image, blade: Blade, other: OtherEye | None, expected: float | None = None
) -> Found:
    """The blade's edges, axis and end. tones (h, w, c): working image, free of dots; smooth: the same `smoothed`.
    expected: direction of the axis in the image (rad, modulo π) where it is known beforehand; lines that run otherwise
    are then none of the blade's edges."""
    noise = sensor_noise(tones)
    lines = hough_lines(tones, noise, 220)
    if expected is not None:
        lines = lines[np.abs(np.cos(lines[:, 0] - expected)) < np.sin(FROM_EXPECTED)]
    candidates = weigh(lines, blade, smooth, noise, other)
    largest = LARGEST_TAPER if expected is None else LARGEST_FLARE
    there = [c for c in candidates if not c.parallax < NOT_THERE]
    typical = typical_edge(there)
    believed = [c for c in there if c.ends[1] - c.ends[0] > LEAST_RUN]
    believed = [
        c for c in believed if c.beyond > 0 or (not _outshone(c, candidates) and like_an_edge(c, tones, typical))
    ]
    clear = [c for c in believed if not _faint_behind_gaps(c, believed, blade)]
    clear, chosen = _chosen(clear, candidates, smooth, blade, other, noise, largest)
    if len(chosen) == 1:
        chosen = with_partner(chosen[0], clear, blade, largest)
    ending = None
    axis = float("nan") if expected is None else expected % np.pi
    closed = None
    if not goes_on(chosen):
        closed = find_closed(believed, blade, smooth, noise, largest)
    if closed is not None and closed.evidence > evidence_of(chosen, blade):
        ending = closed.ending
        station = ending.shoulder - BEHIND_SHOULDER
        chosen = tuple(trimmed(edge, ending.toward, station, blade.camera) for edge in closed.edges)
    elif chosen and (missing := unexplained(chosen, blade)) > MOST_MISSING:
        return Found((), axis, None, (f"no edge: {missing:.0%} of the dots within the likeliest ones are missing",))
    elif contradicted(chosen):
        return Found((), axis, None, ("no edge: steps and dots contradict each other",))
    if ending is not None:
        axis = float(np.arctan2(ending.toward[1], ending.toward[0]) % np.pi)
        if not chosen:
            return Found((), axis, ending, ("no edge: only the spiked tip is in view",))
    if not chosen:
        return Found((), axis, None, (f"no edge: {_why_none(candidates, believed, blade)}",))
    chosen = tuple(settled(edge, ending is not None, _bend_at_focus(edge, blade)) for edge in chosen)
    told = tuple(c for c in chosen if _sure(c))
    if not told:
        least = np.rad2deg(min(float(c.profile.slope_sigma[c.index]) for c in chosen))
        return Found((), axis, ending, (f"no edge: its direction is known only to {least:.1f}°",))
    chosen = told
    directions = np.array([np.arctan2(c.outward[1], c.outward[0]) + np.pi / 2 for c in chosen])
    axis = 0.5 * np.angle(np.exp(2j * directions).sum()) % np.pi
    return Found(chosen, float(axis), ending, ())


def _chosen(
    clear: list[Candidate],
    candidates: list[Candidate],
    smooth: Image,
    blade: Blade,
    other: OtherEye | None,
    noise: float,
    largest: float,
) -> tuple[list[Candidate], tuple[Candidate, ...]]:
    """The candidates beyond which the blade does not go on, as far as that was asked, and the chosen ones of them."""
    asked: list[Candidate] = []
    while True:
        chosen = _choose([c for c in clear if not _hides_nothing(c, candidates, blade)], blade, largest)
        new = [c for c in chosen if c.beyond == 0 and c not in asked]
        if other is None or not new:
            return clear, chosen
        asked += new
        on_blade = [c for c in new if continues(c, smooth, other, noise)]
        clear = [c for c in clear if c not in on_blade]


def _sure(edge: Candidate) -> bool:
    """Whether an edge's direction is known well enough to tell of it."""
    most = SHORT_UNSURE if edge.ends[1] - edge.ends[0] < SHORT else UNSURE
    return bool(edge.profile.slope_sigma[edge.index] < most)


def _why_none(candidates: list[Candidate], believed: list[Candidate], blade: Blade) -> str:
    """What speaks against the line that would sooner be an edge than any other."""
    if not candidates:
        return "no step goes on beside the dots"
    best = max(candidates, key=lambda c: (c.value, c.worth))
    if best.support < LEAST_SUPPORT:
        return f"the best line shows a step on {best.support:.0%} of its way beside the dots"
    if best.parallax < NOT_THERE:
        return "the best line lies behind the blade, as the other eye sees it"
    if best not in believed:
        return "the best line is imaged as a shadow, a seam or a streak is, and no dots are missing beyond it"
    if best.empty > MOST_EMPTY:
        return f"{best.empty:.0%} of the dots before the best line are missing"
    if best.blocked > 0.5:
        return "a step as strong lies between the best line and the dots"
    return f"the best line is no clearer than the blade's own texture of {blade.texture:.0f} grey levels"


def _bend_at_focus(edge: Candidate, blade: Blade) -> float:
    place = edge.profile.direction[edge.index] * float(edge.profile.focus[edge.index])
    return lens_bend(blade.camera, edge.outward * edge.rho + place, edge.outward)


def _outshone(one: Candidate, candidates: list[Candidate]) -> bool:
    """Whether a far clearer step, against which nothing speaks, runs across one that no dots tell of: where a blade is
    wider than the laser's grid, streaks along its chord enclose the dots as its edges do."""
    return any(
        c.step > OUTSHINES * one.step
        and c.empty <= MOST_EMPTY
        and c.blocked < 0.5
        and c.support >= LEAST_SUPPORT
        and abs(float(c.outward @ one.outward)) < np.cos(LARGEST_FLARE)
        for c in candidates
    )


def _faint_behind_gaps(one: Candidate, believed: list[Candidate], blade: Blade) -> bool:
    """Whether a step hardly clearer than the blade's own shade, and far fainter than the edge on the other side where
    there is one, has dots missing before it: there the blade has ended, too faintly to be seen, and this is of what is
    behind it."""
    across = [
        c.step for c in believed if c.beyond >= LEAST_GONE and c.value >= LEAST_VALUE and c.outward @ one.outward < 0
    ]
    if across and one.step > max(across) / 2:
        return False
    if one.step >= PLAIN * blade.texture or one.empty == 0 or len(blade.dots) < 2:
        return False
    depth, dots = blade.absent @ one.outward - one.rho, blade.dots @ one.outward - one.rho
    before = (depth < -4.0) & (depth > np.median(dots))
    gone, depth = blade.absent[before], depth[before]
    way = np.array([-one.outward[1], one.outward[0]])
    # Where a dot is seen as far out beside a gap, dirt hides one: the blade has not ended.
    level = np.abs((gone @ way)[:, None] - blade.dots @ way) < LEVEL_ALONG * blade.spacing
    level &= dots > depth[:, None] - LEVEL_OUT * blade.spacing
    return int((~level.any(axis=1)).sum()) >= LEAST_GONE


def _hides_nothing(one: Candidate, candidates: list[Candidate], blade: Blade) -> bool:
    """Whether a step nearer to the dots is an edge as well, and dots are missing and none are seen in between: then
    the farther step is none of the blade's."""
    for near in candidates:
        if near.value < LEAST_VALUE or float(near.outward @ one.outward) < np.cos(LARGEST_TAPER):
            continue
        gone, seen = (
            int(((points @ one.outward < one.rho - 4.0) & (points @ near.outward > near.rho + 4.0)).sum())
            for points in (blade.absent, blade.dots)
        )
        if gone >= LEAST_GONE and seen == 0:
            return True
    return False


def _choose(candidates: list[Candidate], blade: Blade, largest: float) -> tuple[Candidate, ...]:
    """The pair of nearly parallel candidates that encloses the dots best, or the best one, or none."""
    good = [c for c in candidates if c.value >= LEAST_VALUE]
    if not good:
        return ()
    good.sort(key=lambda c: -c.value)
    best_pair: tuple[float, tuple[Candidate, ...]] | None = None
    for a in range(len(good)):
        for b in range(a + 1, len(good)):
            if not opposite(good[a], good[b], blade, largest):
                continue
            total = good[a].value + good[b].value + SEEN_ON * (seen_on(good[a]) + seen_on(good[b]))
            if best_pair is None or total > best_pair[0]:
                best_pair = (total, (good[a], good[b]))
    if best_pair is not None and min(c.value for c in best_pair[1]) > good[0].value - SECOND_EDGE:
        return best_pair[1]
    alone = [c for c in good if c.beyond or c.parallax > 0.5 or c.step > PLAIN * blade.texture]
    return tuple(alone[:1])


def edge_of(candidate: Candidate, factor: float) -> Edge:
    """The candidate as an edge in pixels of the full image."""
    normal = candidate.outward if candidate.rho >= 0 else -candidate.outward
    profile, k = candidate.profile, candidate.index
    ends = np.array(candidate.ends)
    direction = profile.direction[k]
    return Edge(
        Line(float(np.arctan2(normal[1], normal[0])), abs(candidate.rho * factor)),
        candidate.outward.copy(),
        float(profile.slope_sigma[k]),
        float(np.hypot(profile.rho_sigma[k], profile.focus[k] * profile.slope_sigma[k]) * factor),
        candidate.support,
        (candidate.outward * candidate.rho + ends[:, None] * direction) * factor,
    )
