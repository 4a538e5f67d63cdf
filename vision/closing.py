"""Where the blade ends in the image: the pair of edges and the end that together explain steps and dots best."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate
from vision.capture import Image
from vision.ending import HOLE, Ending, Side, fit_ending, side_beside, side_of
from vision.evidence import Blade

Array = NDArray[Any]  # of floats

MOST = 14  # candidates that are tried as edges of a blade that ends
WORTH = 10.0  # of one unit of a candidate's worth, as evidence
ALONE = -12.0  # evidence of a blade of which one edge is not seen
CLEAR = 5.0  # evidence by which a blade that ends must be likelier than one that goes on
LEAST_SHARE = 0.5  # of the lanes that close
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
    total = 0.0
    for edge in edges:
        side = side_of(edge, edge.profile.direction[edge.index])
        total += float(side.evidence.sum()) + WORTH * edge.worth
        if len(blade.absent):
            inside &= blade.absent @ edge.outward < edge.rho - 4.0
    return total + (HOLE if blade.grid_known else HOLE / 2) * float(inside.sum()) + (ALONE if len(edges) == 1 else 0.0)


def goes_on(edges: tuple[Candidate, ...]) -> bool:
    """Whether two edges are seen to leave the image at both ends."""
    return len(edges) == 2 and not any(
        _ends(edge, sign * edge.profile.direction[edge.index]) for edge in edges for sign in (1.0, -1.0)
    )


def find_closed(
    candidates: list[Candidate], blade: Blade, smooth: Image, noise: float, largest: float
) -> Closed | None:
    """The likeliest blade that ends in the image, None where none is likelier than its going on.

    largest: angle between two edges, rad."""
    best: Closed | None = None
    for edges, sides, toward in _hypotheses(candidates[:MOST], blade, largest):
        usual = float(np.mean([edge.step for edge in edges]))
        others = WORTH * sum(edge.worth for edge in edges) + (ALONE if len(edges) == 1 else 0.0)
        least = -np.inf if best is None else best.evidence - others
        ending = fit_ending(smooth, noise, sides, toward, blade, usual, least)
        if ending is None or ending.share < LEAST_SHARE or ending.evidence < ending.goes_on + CLEAR:
            continue
        if ending.evidence > least:
            best = Closed(edges, ending, ending.evidence + others)
    return best


def _hypotheses(
    candidates: list[Candidate], blade: Blade, largest: float
) -> Iterator[tuple[tuple[Candidate, ...], tuple[Side, Side], Array]]:
    for a, one in enumerate(candidates):
        for two in candidates[a + 1 :]:
            if float(-one.outward @ two.outward) < np.cos(largest):
                continue
            way = one.outward - two.outward
            way = np.array([-way[1], way[0]]) / np.linalg.norm(way)
            for toward in (way, -way):
                if any(_ends(edge, toward) for edge in (one, two)):
                    across = np.array([-toward[1], toward[0]])
                    low, high = sorted((one, two), key=lambda edge: float(edge.outward @ across))
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


def trimmed(edge: Candidate, toward: Array, station: float) -> Candidate:
    """The edge fitted to its steps before a station along `toward` (2,), px: where an end no longer bends it."""
    profile, k = edge.profile, edge.index
    direction, t = profile.direction[k], profile.t[k]
    before = edge.rho * float(edge.outward @ toward) + t * float(direction @ toward) < station
    use = before & (t >= edge.ends[0] - 1) & (t <= edge.ends[1] + 1) & np.isfinite(profile.offset[k])
    if use.sum() < 10 or use.sum() > 0.97 * ((t >= edge.ends[0] - 1) & (t <= edge.ends[1] + 1)).sum():
        return edge
    focus = float(np.clip(0.0, t[use].min(), t[use].max()))
    place = t - focus
    offset = profile.offset[k] + 0.5 * profile.bend[k] * (t - profile.focus[k]) ** 2
    fit = np.array([float(np.median(offset[use])), 0.0])
    terms = np.column_stack([np.ones_like(place), place])
    held = np.diag([1e-4, 1e-4 / 0.05**2])
    for tolerance in (2.0, 1.2, 0.8, 0.8):
        weight = use / (1 + ((offset - terms @ fit) / tolerance) ** 2) ** 2
        information = (terms * weight[:, None]).T @ terms + held
        fit = np.linalg.solve(information, (terms * weight[:, None]).T @ offset)
    turn = float(np.arctan(fit[1]))
    normal = edge.outward * np.cos(turn) - direction * np.sin(turn)
    point = edge.outward * (edge.rho + fit[0]) + direction * focus
    rho = float(normal @ point)
    moved = replace(profile, normal=profile.normal.copy(), rho=profile.rho.copy())
    moved.normal[k], moved.rho[k] = normal, rho
    covariance = np.linalg.inv(information)
    residual = offset - terms @ fit
    scatter2 = float((residual**2 * weight).sum() / weight.sum()) + 0.01
    slope_sigma, rho_sigma = profile.slope_sigma.copy(), profile.rho_sigma.copy()
    slope_sigma[k] = np.sqrt(2 * scatter2 * covariance[1, 1])
    rho_sigma[k] = np.sqrt(2 * scatter2 * covariance[0, 0] + 0.04**2)
    moved = replace(moved, slope_sigma=slope_sigma, rho_sigma=rho_sigma)
    reach = (float(max(edge.ends[0], t[use].min())), float(min(edge.ends[1], t[use].max())))
    return replace(edge, outward=normal, rho=rho, profile=moved, ends=reach)
