"""The outline of a blade in one photograph, as it is seen from its dots: whoever walks outward from a dot meets the
blade's edge first.

A line is an edge of the blade where the way to it from the dots is free of steps as strong, where the step on it goes
on beside all those dots, and where no dot, and no place at which one is missing, contradicts it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.lines import Profiles, edge_pixels, hough_lines, refine_lines, sampled, sensor_noise, smoothed
from vision.outward import BOX, change_along, first_steps, lines_through, texture_between

Array = NDArray[Any]  # of floats

PLACES = 48  # along a line at which the way to it is tried
BESIDE = 10.0  # px by which an edge is followed past the first and last dot beside it
ON_LINE = 3.5  # px from a line within which a step is on it
STRAYS = 0.035  # share of the dots that may lie beyond an edge all the same
LEVELS = (1.0, 2.0, 4.0)  # times the blade's own texture: what counts as a step in turn
LEAST_SHARE, LEAST_SECOND = 0.6, 0.5  # of an edge alone, and of one beside a better one
SAME_PX, SAME_TURN = 14.0, np.deg2rad(5)  # between lines of which one is the other's shoulder
USUAL_TAPER, LARGEST_TAPER = np.deg2rad(16), np.deg2rad(32)
ACROSS = np.deg2rad(40)  # by which a tip may lie askew
PAST_TIP = 30.0  # px: further past the tip no edge is seen


@dataclass(frozen=True, eq=False)
class Side:
    """One straight piece of the outline: outward normal (2,) and offset, image frame, working px. share: of the ways
    from the dots that meet it first. step: its height in grey levels. empty: share of the dots expected before it that
    are missing. ends: between which it is seen, along the direction."""

    outward: Array
    rho: float
    share: float
    step: float
    empty: float
    ends: tuple[float, float]
    value: float
    profile: Profiles
    index: int

    @property
    def direction(self) -> Array:
        """Unit vector (2,) along it."""
        return np.asarray(self.profile.direction[self.index], float)


@dataclass(frozen=True)
class Silhouette:
    """Edges (none, one or two) and the tip across them, None where the blade leaves the image; the axis modulo π, NaN
    without edges; reasons where there is no edge."""

    edges: tuple[Side, ...]
    tip: Side | None
    axis: float
    reasons: tuple[str, ...]


def find_silhouette(tones: Image, dots: Array, outer: Array, absent: Array, spacing: float) -> Silhouette:
    """The outline of the blade that carries dots (n, 2); outer (k, 2): those of them with a free place beside them;
    absent (m, 2): where one is missing. tones (h, w, c): working image without dots. Image frame, working px."""
    smooth = smoothed(tones)
    noise = sensor_noise(tones)
    texture = texture_between(smooth, dots, spacing)
    least = max(5.0, 3.0 * noise, 1.3 * texture)
    height, width = tones.shape[:2]
    lines, _ = hough_lines(edge_pixels(tones, noise), 220, (width, height))
    first = [first_steps(smooth, outer, level * least) for level in LEVELS]
    normal = np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    seen = np.concatenate(
        [*(lines_through(points, dots, STRAYS) for points in first), np.column_stack([normal, lines[:, 1]])]
    )
    sides = _sides(seen, smooth, noise, least, dots, absent, spacing)
    return _chosen(sides)


def _sides(
    lines: Array, smooth: Image, noise: float, least: float, dots: Array, absent: Array, spacing: float
) -> list[Side]:
    """The lines (k, 3), refined and weighed; those that the dots do not contradict."""
    normal, rho = lines[:, :2].copy(), lines[:, 2].copy()
    distance = dots @ normal.T - rho
    flip = (distance > -5).mean(axis=0) > (distance < 5).mean(axis=0)
    normal[flip], rho[flip] = -normal[flip], -rho[flip]
    keep = (dots @ normal.T - rho < 5).mean(axis=0) >= 1 - 1.5 * STRAYS
    normal, rho = normal[keep], rho[keep]
    sides: list[Side] = []
    if len(rho) == 0:
        return sides
    for reach, slopes in ((5, 2.4), (4, 0.8)):
        low, high = _beside(dots, normal)
        profile = refine_lines(smooth, normal, rho, noise, np.clip(0.0, low, high), reach, slopes, PLACES * 2)
        normal, rho = profile.normal, profile.rho
    low, high = _beside(dots, normal)
    for k in np.flatnonzero((dots @ normal.T - rho > 3).mean(axis=0) <= STRAYS).tolist():
        share, step = _share(smooth, normal[k], float(rho[k]), float(low[k]), float(high[k]), dots, least)
        if share < 0.3:
            continue
        along = np.array([-normal[k, 1], normal[k, 0]])
        beside = (absent @ along > low[k]) & (absent @ along < high[k])
        gone = absent @ normal[k] - rho[k]
        middle = float(np.median(dots @ normal[k])) - rho[k]
        count = int((beside & (gone < -0.35 * spacing) & (gone > middle)).sum())
        there = int((dots @ normal[k] - rho[k] > middle).sum())
        empty = count / max(count + there, 1)
        told = min(float(np.log2(max(step, 1.0) / least)), 3.0)
        value = share - 2.5 * empty + 0.06 * told
        sides.append(Side(normal[k], float(rho[k]), share, step, empty, _run(profile, k), value, profile, k))
    return _distinct(sorted(sides, key=lambda side: -side.value), dots)


def _distinct(sides: list[Side], dots: Array) -> list[Side]:
    """Of lines that nearly coincide beside the dots the one with the highest step, if as much of it is seen."""
    kept: list[Side] = []
    for side in sides:
        twin = next((k for k, other in enumerate(kept) if _same(side, other, dots)), None)
        if twin is None:
            kept.append(side)
        elif side.step > 1.5 * kept[twin].step and side.share > 0.75 * kept[twin].share:
            kept[twin] = side
    return kept


def _same(one: Side, two: Side, dots: Array) -> bool:
    if float(one.outward @ two.outward) < np.cos(SAME_TURN):
        return False
    middle = one.outward * one.rho + one.direction * float(np.median(dots @ one.direction))
    return abs(float(middle @ two.outward) - two.rho) < SAME_PX


def _beside(dots: Array, normal: Array) -> tuple[Array, Array]:
    """The stretch (low, high) (k,) of each line that has dots beside it."""
    along = dots @ np.stack([-normal[:, 1], normal[:, 0]])
    return np.quantile(along, 0.02, axis=0), np.quantile(along, 0.98, axis=0)


def _share(
    smooth: Image, normal: Array, rho: float, low: float, high: float, dots: Array, least: float
) -> tuple[float, float]:
    """Share of the places along a line at which whoever comes from the nearest dots meets a step first on it, and how
    high that step is. Places outside the image do not count."""
    height, width = smooth.shape[:2]
    centre = (np.array([width, height]) - 1) / 2
    along = np.array([-normal[1], normal[0]])
    places = np.linspace(low - BESIDE, high + BESIDE, PLACES)
    where = normal * rho + places[:, None] * along + centre
    inside = ((where > 4) & (where < 2 * centre - 4)).all(axis=1)
    if inside.sum() < 6:
        return 0.0, 0.0
    places, where = places[inside], where[inside]
    # The dot that stands nearest to the line near each place.
    reach = np.abs(dots @ along - places[:, None])
    depth = np.where(reach < 40, rho - dots @ normal + 0.5 * reach, np.inf).min(axis=1)
    depth = np.clip(np.where(np.isfinite(depth), depth, 60.0), 0.0, 200.0)
    inward = np.arange(-BOX - 5.0, min(float(depth.max()), 200.0) + 2 * BOX + 2)
    uv = where[:, None] - inward[:, None] * normal
    change = change_along(sampled(smooth, uv[..., 0], uv[..., 1]))
    here = np.where(np.abs(inward) <= ON_LINE, change, 0).max(axis=1)
    between = np.where((inward > ON_LINE + BOX) & (inward < depth[:, None] - 3), change, 0).max(axis=1)
    step = float(np.median(here))
    strong = here > np.maximum(0.5 * least, 0.35 * step)
    free = between < np.maximum(0.8 * least, 0.75 * np.minimum(here, step * 1.5))
    return float((strong & free).mean()), step


def _run(profile: Profiles, k: int) -> tuple[float, float]:
    """Between which places about its focus line k is seen, small gaps left aside."""
    t, agrees = profile.t[k], np.convolve(profile.agrees[k], np.ones(5) / 5, mode="same") > 0.5
    near = np.flatnonzero(agrees)
    if len(near) == 0:
        return float(t[0]), float(t[-1])
    at = int(near[np.argmin(np.abs(t[near] - profile.focus[k]))])
    gap = max(int(40 / max(t[1] - t[0], 1e-6)), 1)
    first = last = at
    while first > 0 and agrees[max(first - gap, 0) : first].any():
        first = max(first - gap, 0) + int(agrees[max(first - gap, 0) : first].argmax())
    while last < len(t) - 1 and agrees[last + 1 : last + 1 + gap].any():
        last = last + 1 + int(np.flatnonzero(agrees[last + 1 : last + 1 + gap])[-1])
    return float(t[first]), float(t[last])


def _chosen(sides: list[Side]) -> Silhouette:
    good = [side for side in sides if side.share >= LEAST_SECOND and side.empty < 0.25]
    alone = [side for side in good if side.share >= LEAST_SHARE]
    if not alone:
        best = max((side.share for side in sides), default=0.0)
        return Silhouette((), None, float("nan"), (f"no edge: the best line beside the dots has {best:.0%} support",))
    worthiest: tuple[float, tuple[Side, ...]] = (alone[0].value - 0.35, (alone[0],))
    for n, one in enumerate(good):
        for two in good[n + 1 :]:
            taper = float(np.arccos(np.clip(-one.outward @ two.outward, -1, 1)))
            if taper > LARGEST_TAPER or max(one.share, two.share) < LEAST_SHARE:
                continue
            if taper > USUAL_TAPER and _tip(sides, (one, two), _axis((one, two))) is None:
                continue
            worth = (one.value + two.value) / 2 + 0.1 - 0.3 * max(taper / USUAL_TAPER - 1, 0)
            if worth > worthiest[0]:
                worthiest = (worth, (one, two))
    edges = worthiest[1]
    axis = _axis(edges)
    return Silhouette(edges, _tip(sides, edges, axis), axis, ())


def _axis(edges: tuple[Side, ...]) -> float:
    """The mean direction of edges (5.14), modulo π."""
    turns = np.array([np.arctan2(side.outward[1], side.outward[0]) + np.pi / 2 for side in edges])
    return float(0.5 * np.angle(np.exp(2j * turns).sum()) % np.pi)


def _tip(sides: list[Side], edges: tuple[Side, ...], axis: float) -> Side | None:
    """The piece of outline across the axis that closes the blade: its edges end there."""
    toward = np.array([np.cos(axis), np.sin(axis)])
    across = [
        side
        for side in sides
        if side.share >= LEAST_SECOND
        and side.empty < 0.25
        and abs(float(side.outward @ toward)) > np.cos(ACROSS)
        and side not in edges
        and all(_ends_at(edge, side) for edge in edges)
    ]
    return max(across, key=lambda side: side.value, default=None)


def _ends_at(edge: Side, tip: Side) -> bool:
    """Whether an edge is not seen to go on beyond a tip."""
    ends = edge.outward * edge.rho + np.array(edge.ends)[:, None] * edge.direction
    return float((ends @ tip.outward).max()) < tip.rho + PAST_TIP
