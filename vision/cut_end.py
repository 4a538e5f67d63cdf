"""A blade that a straight line cuts off, square or askew, at corners that may be rounded; its edges may draw together
more than those of a blade that goes on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import LEAST_RUN, Candidate
from vision.closing import ALONE, WORTH, evidence_of
from vision.edge_fit import trimmed
from vision.edges import Found
from vision.ending import HOLE, SEEN, UNSEEN, Ending, side_of
from vision.evidence import Blade

Array = NDArray[Any]  # of floats

MOST = 12  # candidates that are tried
LARGEST_TAPER = np.deg2rad(42)  # of a blade toward its end
ASKEW = np.deg2rad(35)  # from square to the axis, of the line that cuts it off
ASKEW_ALONE = np.deg2rad(20)  # the same where only one edge is seen
PAST_PX = 48.0  # past a corner, over which a step must not go on
ROUND = 0.35  # of the width: a corner may be rounded over as much of each side
CLEAR = 5.0  # evidence by which a blade that is cut off must be likelier than what was found
LEAST_WORTH = -1.2
LEAST_SUPPORT = 0.3
AHEAD_PX = 45.0  # so far before a cut the blade's last dots lie, at most
DOT_ROOM = 4.0  # px
BORDER = 8.0  # px: a corner nearer to the image border than this is not seen


@dataclass(frozen=True)
class Cut:
    """A blade that ends: the one or two candidates along it, the one across it, where that begins and ends, and what
    speaks for it all."""

    edges: tuple[Candidate, ...]
    across: Candidate
    corners: tuple[Array, Array]
    toward: Array
    evidence: float


def with_cut_end(found: Found, candidates: list[Candidate], blade: Blade, size: tuple[int, int]) -> Found:
    """What was found, or the same blade cut off by a straight line where that explains steps and dots better.

    size: (width, height) of the working image."""
    cut = _likeliest(candidates[:MOST], blade, (np.array(size) - 1) / 2)
    least = max(_evidence_of(found, blade), 0.0) + (CLEAR if found.edges else 0.0)
    if cut is None or cut.evidence < least:
        return found
    one, two = cut.corners
    middle = (one + two) / 2
    toward, outward = cut.toward, cut.across.outward
    station = min(float(corner @ toward) for corner in cut.corners)
    round_off = ROUND * float(np.hypot(*(one - two)))
    edges = tuple(trimmed(edge, toward, station - round_off / 2) for edge in cut.edges)
    turns = np.array([np.arctan2(edge.outward[1], edge.outward[0]) + np.pi / 2 for edge in edges])
    axis = float(0.5 * np.angle(np.exp(2j * turns).sum()) % np.pi)
    side = np.array([-outward[1], outward[0]])
    ending = Ending(
        outward, cut.across.rho, float(middle @ side), station - round_off, cut.across.support,
        float(cut.across.profile.rho_sigma[cut.across.index]) + 0.5, cut.evidence, -np.inf,
    )  # fmt: skip
    return Found(edges, axis, ending, ())


def _evidence_of(found: Found, blade: Blade) -> float:
    if found.ending is None:
        return evidence_of(found.edges, blade)
    others = WORTH * sum(edge.worth for edge in found.edges) + (ALONE if len(found.edges) == 1 else 0.0)
    return found.ending.evidence + (others if np.isfinite(found.ending.goes_on) else 0.0)


def _likeliest(candidates: list[Candidate], blade: Blade, half: Array) -> Cut | None:
    best: Cut | None = None
    usable = [c for c in candidates if c.worth > LEAST_WORTH and c.support > LEAST_SUPPORT]
    pairs: list[tuple[Candidate, ...]] = [(one,) for one in usable]
    pairs += [
        (one, two)
        for a, one in enumerate(usable)
        for two in usable[a + 1 :]
        if float(-one.outward @ two.outward) > np.cos(LARGEST_TAPER)
    ]
    for edges in pairs:
        way = edges[0].outward - (edges[1].outward if len(edges) == 2 else -edges[0].outward)
        way = np.array([-way[1], way[0]]) / np.linalg.norm(way)
        for across in usable:
            lean = float(across.outward @ way)
            if across in edges or abs(lean) < np.cos(ASKEW if len(edges) == 2 else ASKEW_ALONE):
                continue
            cut = _cut(edges, across, np.sign(lean) * way, blade, half)
            if cut is not None and (best is None or cut.evidence > best.evidence):
                best = cut
    return best


def _cut(edges: tuple[Candidate, ...], across: Candidate, toward: Array, blade: Blade, half: Array) -> Cut | None:
    ends = [across.outward * across.rho + end * across.profile.direction[across.index] for end in across.ends]
    far = _crossing(edges[1], across) if len(edges) == 2 else min(ends, key=lambda end: float(end @ edges[0].outward))
    corners = (_crossing(edges[0], across), far)
    wide = float(np.hypot(*(corners[0] - corners[1])))
    if wide < LEAST_RUN or any((np.abs(corner) > half - BORDER).any() for corner in corners[: len(edges)]):
        return None
    if float((blade.dots @ across.outward).max()) < across.rho - AHEAD_PX:
        return None
    slack = ROUND * wide
    evidence = WORTH * sum(side.worth for side in (*edges, across)) + (ALONE if len(edges) == 1 else 0.0)
    for edge, corner in zip(edges, corners, strict=False):
        seen = side_of(edge, toward)
        end = float(corner @ toward)
        before, past = seen.stations < end - 4, (seen.stations > end + 6) & (seen.stations < end + PAST_PX)
        evidence += float(_forgiven(seen.evidence, before & (seen.stations > end - slack))[before].sum())
        evidence -= max(float(seen.evidence[past].sum()), 0.0)
    profile, k = across.profile, across.index
    direction, t = profile.direction[k], profile.t[k]
    first, last = sorted(float(corner @ direction) for corner in corners)
    tells = np.where(profile.agrees[k], SEEN, UNSEEN) * abs(float(t[1] - t[0])) / 8.0
    between, past = (
        (t > first) & (t < last),
        ((t < first - 6) & (t > first - PAST_PX)) | ((t > last + 6) & (t < last + PAST_PX)),
    )
    near = between & ((t < first + slack) | (t > last - slack))
    past &= (t < last) | (len(edges) == 2) | (float((corners[1] - corners[0]) @ direction) < 0)
    past &= (t > first) | (len(edges) == 2) | (float((corners[1] - corners[0]) @ direction) > 0)
    seen_across = float(_forgiven(tells, near)[between].sum())
    if seen_across < 0:
        return None
    evidence += seen_across - max(float(tells[past].sum()), 0.0)
    if len(blade.absent):
        inside = np.all([blade.absent @ side.outward < side.rho - DOT_ROOM for side in (*edges, across)], axis=0)
        evidence += HOLE * float(inside.sum())
    return Cut(edges, across, corners, toward, evidence)


def _forgiven(tells: Array, near: NDArray[np.bool_]) -> Array:
    """What places tell, of which those near a rounded corner tell nothing where no step is seen."""
    return np.where(near & (tells < 0), 0.0, tells)


def _crossing(one: Candidate, two: Candidate) -> Array:
    return np.asarray(np.linalg.solve(np.stack([one.outward, two.outward]), np.array([one.rho, two.rho])), float)
