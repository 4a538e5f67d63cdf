"""Where the blade ends in the image: the pair of edges and the end that together explain steps and dots best."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import acos, hypot, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import LEAST_RUN, Candidate
from vision.capture import Image
from vision.ending import CLEAR, HOLE, LEAST_SHARE, Ending, Side, fit_ending, side_beside, side_of
from vision.evidence import Blade
from vision.surface_kernels import median

Array = NDArray[Any]  # of floats

MOST = 14  # candidates that are tried as edges of a blade that ends
WORTH = 10.0  # of one unit of a candidate's worth, as evidence
ALONE = -12.0  # evidence of a blade of which one edge is not seen
NARROWEST, WIDEST = np.deg2rad(20), np.deg2rad(84)  # angle of a spike
OFF_AXIS = np.deg2rad(14)  # from a spike's middle to an edge of the blade, and to its dots
AT_CORNER = 35.0  # px along the axis from where a spike's side meets an edge to where it ends
PAST_PX = 60.0  # past its apex, over which a side of a spike must not go on
MOST_PAST = 0.6  # of that stretch, on which a step may be seen all the same
LEAST_PARTNER = -0.2  # worth of an edge beside which no dots lie
LEAST_WORTH = -1.0  # of an edge behind a spike
TOLD = 0.9  # of a step seen by the other eye at the blade's depth: such a one is there, wherever it is lost
BORDER = 14.0  # px: an edge that is seen to within this of the image border has not ended


@dataclass(frozen=True)
class Closed:
    """A blade that ends: its edges (one or two), how it ends, and the evidence for it all."""

    edges: tuple[Candidate, ...]
    ending: Ending
    evidence: float


def evidence_of(edges: tuple[Candidate, ...], blade: Blade) -> float:
    """What speaks for a blade with these edges that goes on through the image; 0 without edges."""
    if not edges:
        return 0.0
    inside = np.ones(len(blade.absent), bool)
    total = sum(seen_on(edge) + WORTH * edge.worth for edge in edges)
    for edge in edges:
        if len(blade.absent):
            inside &= blade.absent @ edge.outward < edge.rho - 4.0
    return total + (HOLE if blade.grid_known else HOLE / 2) * float(inside.sum()) + (ALONE if len(edges) == 1 else 0.0)


def opposite(one: Candidate, two: Candidate, blade: Blade, largest: float) -> bool:
    """Whether two candidates face away from each other and are parallel on the blade, but for an angle (rad)."""
    if float(-one.outward @ two.outward) < np.cos(2.0 * largest):
        return False
    ways = []
    for edge in (one, two):
        direction = edge.profile.direction[edge.index]
        middle = edge.outward * edge.rho + sum(edge.ends) / 2 * direction
        ways.append(blade.on_surface(middle, direction))
    return bool(float(-ways[0] @ ways[1]) > np.cos(largest))


def goes_on(edges: tuple[Candidate, ...]) -> bool:
    """Whether two edges are seen to leave the image at both ends."""
    return len(edges) == 2 and not any(
        _ends(edge, sign * edge.profile.direction[edge.index]) for edge in edges for sign in (1.0, -1.0)
    )


def unexplained(edges: tuple[Candidate, ...], blade: Blade) -> float:
    """Share of missing dots among all that ought to lie on a blade with these edges, beside the stretch of them that
    dots lie beside; before the edge, where only one is known."""
    if len(edges) == 1:
        return edges[0].empty
    if not blade.grid_known or len(blade.absent) == 0:
        return 0.0
    way = edges[0].profile.direction[edges[0].index]
    along, gone = blade.dots @ way, blade.absent @ way
    inside = (gone > along.min()) & (gone < along.max())
    for edge in edges:
        inside &= blade.absent @ edge.outward < edge.rho - 4.0
    return float(inside.sum() / (inside.sum() + len(blade.dots)))


def seen_on(edge: Candidate) -> float:
    """What all the places along an edge say for it."""
    return float(side_of(edge, edge.profile.direction[edge.index]).sums[-1])


def contradicted(edges: tuple[Candidate, ...]) -> bool:
    """Whether more speaks against edges that are seen nowhere else than where they are lost than for them."""
    told = [edge.parallax > TOLD and edge.beyond > 0 and edge.empty == 0 for edge in edges]
    seen = (max(seen_on(edge), 0.0) if sure else seen_on(edge) for edge, sure in zip(edges, told, strict=True))
    return sum(seen) + WORTH * sum(edge.worth for edge in edges) < 0


def find_closed(
    candidates: list[Candidate], blade: Blade, smooth: Image, noise: float, largest: float
) -> Closed | None:
    """The likeliest blade that ends in the image, None where none is likelier than its going on.

    largest: angle between two edges, rad."""
    best = _likeliest_spike(candidates, blade, (smooth.shape[1], smooth.shape[0]))
    for edges, sides, toward in _hypotheses(candidates[:MOST], blade, largest):
        usual = sum(edge.step for edge in edges) / len(edges)
        others = WORTH * sum(edge.worth for edge in edges) + (ALONE if len(edges) == 1 else 0.0)
        least = -np.inf if best is None else best.evidence - others
        ending = fit_ending(smooth, noise, sides, toward, blade, usual, least)
        if ending is None or ending.share < LEAST_SHARE or ending.evidence < ending.goes_on + CLEAR:
            continue
        if ending.evidence > max(least, -others):
            best = Closed(edges, ending, ending.evidence + others)
    return best


def _likeliest_spike(candidates: list[Candidate], blade: Blade, size: tuple[int, int]) -> Closed | None:
    """Two steps that meet in a point just beyond all dots: they close the blade and are not its edges, which lie
    behind."""
    half = (np.array(size) - 1) / 2
    best: Closed | None = None
    middle = np.array([median(np.ascontiguousarray(blade.dots[:, 0])), median(np.ascontiguousarray(blade.dots[:, 1]))])
    for a, one in enumerate(candidates[:MOST]):
        for two in candidates[a + 1 : MOST]:
            (x, y), (other_x, other_y) = one.outward.tolist(), two.outward.tolist()
            opening = pi - acos(min(max(x * other_x + y * other_y, -1.0), 1.0))
            if not NARROWEST < opening < WIDEST:
                continue
            apex = np.linalg.solve(np.stack([one.outward, two.outward]), np.array([one.rho, two.rho]))
            toward = one.outward + two.outward
            toward = toward / np.linalg.norm(toward)
            ahead = float(((blade.dots - apex) @ toward).max())
            back = apex - middle
            if (np.abs(apex) > half - 4).any() or not -90.0 < ahead < 2.0:
                continue
            if float(back @ toward) < np.cos(OFF_AXIS) * float(np.hypot(*back)):
                continue
            evidence = _up_to(one, apex, toward) + _up_to(two, apex, toward) + WORTH * (one.worth + two.worth)
            if len(blade.absent):
                inside = (blade.absent @ one.outward < one.rho - 4) & (blade.absent @ two.outward < two.rho - 4)
                evidence += (HOLE if blade.grid_known else HOLE / 2) * float(inside.sum())
            if evidence > 0 and (best is None or evidence > best.evidence):
                sides = _behind(candidates, (one, two), apex, toward)
                shoulder = min((_far_end(side, toward) for side in (one, two)), default=0.0)
                across = np.array([-toward[1], toward[0]])
                sigma = float(np.hypot(*(side.profile.rho_sigma[side.index] for side in (one, two))))
                sigma /= np.sqrt(2) * np.sin(opening / 2)
                ending = Ending(
                    toward, float(apex @ toward), float(apex @ across), shoulder, 1.0, sigma, evidence, -np.inf
                )
                best = Closed(sides, ending, evidence)
    return best


def _up_to(side: Candidate, apex: Array, toward: Array) -> float:
    """What a step says for a side of a spike, from where it comes into view or begins, up to the apex and no
    further."""
    seen = side_of(side, toward)
    station = float(apex @ toward)
    start = _far_end(side, toward)
    if station - start < LEAST_RUN:
        return -np.inf
    before = (seen.stations > start - 1) & (seen.stations < station - 4)
    past = (seen.stations > station + 4) & (seen.stations < station + PAST_PX)
    if past.any() and (seen.evidence[past] > 0).mean() > MOST_PAST:
        return -np.inf
    return float(seen.evidence[before].sum() - seen.evidence[past].sum())


def _far_end(side: Candidate, toward: Array) -> float:
    direction = side.profile.direction[side.index]
    foot = side.rho * float(side.outward @ toward)
    return min(foot + place * float(direction @ toward) for place in side.ends)


def _behind(
    candidates: list[Candidate], sides: tuple[Candidate, Candidate], apex: Array, toward: Array
) -> tuple[Candidate, ...]:
    """The blade's own edges, nearly along the axis of a spike, that go on from where its sides end: the best of each
    side of it; none, one or two."""
    found = []
    across = np.array([-toward[1], toward[0]])
    for sign in (1.0, -1.0):
        side = max(sides, key=lambda edge: sign * float(edge.outward @ across))
        fitting = []
        for edge in candidates:
            if edge in sides or sign * float(edge.outward @ across) < np.cos(OFF_AXIS) or edge.worth < LEAST_WORTH:
                continue
            corner = np.linalg.solve(np.stack([edge.outward, side.outward]), np.array([edge.rho, side.rho]))
            station = float(corner @ toward)
            if abs(station - _far_end(side, toward)) > AT_CORNER or not _ends(edge, toward):
                continue
            seen = side_of(edge, toward)
            before = seen.stations < station - 4
            evidence = float(seen.evidence[before].sum()) if before.sum() > 6 else -1.0
            if evidence > 0:
                fitting.append((evidence + WORTH * edge.worth, edge))
        if fitting:
            found.append(max(fitting, key=lambda one: one[0])[1])
    return tuple(found)


def _hypotheses(
    candidates: list[Candidate], blade: Blade, largest: float
) -> Iterator[tuple[tuple[Candidate, ...], tuple[Side, Side], Array]]:
    for a, one in enumerate(candidates):
        for two in candidates[a + 1 :]:
            if not opposite(one, two, blade, largest):
                continue
            x, y = (one.outward - two.outward).tolist()
            way = np.array([-y, x]) / hypot(x, y)
            for toward in (way, -way):
                if any(_ends(edge, toward) for edge in (one, two)):
                    across = np.array([-toward[1], toward[0]])
                    low, high = (one, two) if one.outward @ across <= two.outward @ across else (two, one)
                    yield (low, high), (side_of(low, toward), side_of(high, toward)), toward
        for toward in (one.profile.direction[one.index], -one.profile.direction[one.index]):
            if _ends(one, toward):
                across = np.array([-toward[1], toward[0]])
                side = side_of(one, toward)
                sign = -float(np.sign(one.outward @ across))
                other = side_beside(blade.dots, toward, sign, side.slope)
                yield (one,), (other, side) if sign < 0 else (side, other), toward


def _ends(edge: Candidate, toward: Array) -> bool:
    """Whether the edge is lost before it leaves the image along `toward`."""
    t, (first, last) = edge.profile.t[edge.index], edge.ends
    if float(edge.profile.direction[edge.index] @ toward) > 0:
        return bool(t[-1] - last > BORDER)
    return bool(first - t[0] > BORDER)


def with_partner(chosen: Candidate, candidates: list[Candidate], blade: Blade, largest: float) -> tuple[Candidate, ...]:
    """An edge, and the blade's other edge where it comes into view only where no dots lie beside it."""
    best: tuple[float, Candidate] | None = None
    for edge in candidates:
        if edge is chosen or edge.worth < LEAST_PARTNER or not opposite(edge, chosen, blade, largest):
            continue
        (first, last), evidence = edge.profile.t[edge.index][[0, -1]], seen_on(edge)
        if edge.ends[1] - edge.ends[0] < 0.75 * (last - first) or evidence < CLEAR:
            continue
        evidence += WORTH * edge.worth
        if best is None or evidence > best[0]:
            best = (evidence, edge)
    return (chosen,) if best is None else (chosen, best[1])
