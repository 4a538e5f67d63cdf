"""Gives rows and columns to dots of one image alone, by growing the lattice they form; for photographs without a rig.

The lattice may lie at any angle, bend and widen with the surface: every dot is expected where a smooth curve through
its settled neighbours leads.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.lattice_seeds import MOST_STEP, UNLIKE, frames_of, reduced

Array = NDArray[Any]  # of floats
Indices = NDArray[np.int64]
Place = tuple[int, int]

OFF_SHADE = 0.45  # by which the brightness around neighbouring dots may differ
OFF_STEP = 0.2  # of the spacing: how far from where its neighbours expect it a dot may lie
SEEDS = 40  # spots from which a lattice is grown
STEP_SIGMA, BEND_SIGMA, PLACE_SIGMA = 0.15, 0.1, 0.02  # of the spacing: what is known of the next dot beforehand
ROUND_ABOUT = [(0, 1), (0, -1), (1, 0), (-1, 0)]
WINDOW = sorted(  # places around one, the nearest first
    ((dr, dc) for dr in range(-3, 4) for dc in range(-3, 4) if 0 < dr * dr + dc * dc <= 10),
    key=lambda d: (d[0] ** 2 + d[1] ** 2, d),
)
NEAR_BY = [*ROUND_ABOUT, (1, 1), (1, -1), (-1, 1), (-1, -1), (0, 2), (0, -2), (2, 0), (-2, 0)]


@dataclass(frozen=True)
class Lattice:
    """Which spots form it (n,), their rows and columns (n,) counted from zero.

    steps (2, 2): px from one dot to the next column, and to the next row. spacing: px, the lesser of the two."""

    member: Indices
    row: Indices
    column: Indices
    steps: Array
    spacing: float

    def __len__(self) -> int:
        return len(self.member)


def find_lattice(uv: Array, level: Array, shade: Array) -> Lattice | None:
    """The largest lattice among spots (n, 2), rows counted down and columns to the right as nearly as it lies. None
    with fewer than four dots.

    level (n,): heights of the spots. shade (n,): how bright it is around each; the lattice does not step where that
    changes suddenly, for there the blade ends."""
    if len(uv) < 4:
        return None
    best: dict[Place, int] = {}
    frame = np.zeros((2, 2))
    used: set[int] = set()
    seeds = [seed for seed in frames_of(uv, level) if seed[0] >= 4]
    for _, start, steps in seeds[:SEEDS]:
        if start in used:
            continue
        if 3 * len(best) > 2 * len(seeds):
            break  # most of what lies evenly is in it already
        grown = _held(uv, _grown(uv, level, shade, {(0, 0): start}, steps))
        used |= set(grown.values())
        if len(grown) > len(best):
            best, frame = grown, steps
    return lattice_of(uv, best, frame) if len(best) >= 4 else None


def grown_on(uv: Array, level: Array, shade: Array, lattice: Lattice) -> Lattice:
    """The lattice grown on over further spots: its own are the first len(lattice) of uv (n, 2), in its order."""
    start = {(int(r), int(c)): k for k, (r, c) in enumerate(zip(lattice.row, lattice.column, strict=True))}
    steps = _mean_steps(uv, start)
    return lattice_of(uv, _held(uv, _grown(uv, level, shade, start, steps)), steps)


def lattice_of(uv: Array, at: dict[Place, int], steps: Array) -> Lattice:
    """The lattice of spots (n, 2) that stand at places, oriented and counted from zero."""
    spots = sorted((spot, place) for place, spot in at.items())
    member = np.array([spot for spot, _ in spots], np.int64)
    place = np.array([where for _, where in spots], np.int64)
    steps = _mean_steps(uv, at, steps)
    shortest = reduced(steps)
    place = np.rint(place[:, ::-1] @ steps @ np.linalg.inv(shortest)).astype(np.int64)[:, ::-1]
    right, down, turned = _turned(shortest)
    place = place @ turned
    place -= place.min(axis=0)
    spacing = float(min(np.hypot(*right), np.hypot(*down)))
    return Lattice(member, place[:, 0], place[:, 1], np.stack([right, down]), spacing)


def onward(uv: Array, lattice: Lattice) -> Array:
    """Where the lattice of spots (n, 2) would go on but does not: next to its dots, (m, 2) px."""
    at = {(int(r), int(c)): int(m) for r, c, m in zip(lattice.row, lattice.column, lattice.member, strict=True)}
    frames = dict.fromkeys(at, lattice.steps)
    free = {(r + dr, c + dc) for r, c in at for dr, dc in ROUND_ABOUT} - set(at)
    return np.array([_expected(uv, at, place, frames)[0] for place in sorted(free)]).reshape(-1, 2)


def outer(lattice: Lattice) -> NDArray[np.bool_]:
    """Which of the lattice's dots (n,) have no dot on one of their four sides."""
    at = set(zip(lattice.row.tolist(), lattice.column.tolist(), strict=True))
    return np.array(
        [
            any((r + dr, c + dc) not in at for dr, dc in ROUND_ABOUT)
            for r, c in zip(lattice.row.tolist(), lattice.column.tolist(), strict=True)
        ]
    )


def missing(uv: Array, lattice: Lattice) -> Array:
    """Where the laser throws dots for certain, (m, 2) px, if there is anything to throw them on: in every row and
    column that has dots, but shows none there. uv (n, 2): the spots."""
    at = {(int(r), int(c)): uv[m] for r, c, m in zip(lattice.row, lattice.column, lattice.member, strict=True)}
    rows, columns = int(lattice.row.max()) + 1, int(lattice.column.max()) + 1
    free = [(r, c) for r in range(rows) for c in range(columns) if (r, c) not in at]
    places, found = np.array(list(at)), []
    where = np.array(list(at.values()))
    for place in free:
        # A plane through the nearest nine: it may lead far, where a curve would lead astray.
        here = places - place
        near = np.argsort(here[:, 0] ** 2 + here[:, 1] ** 2, kind="stable")[:9]
        design = np.column_stack([np.ones(len(near)), here[near, 1], here[near, 0]])
        held = np.diag([0.0, 1.0, 1.0])
        known = np.vstack([np.zeros(2), lattice.steps])
        found.append(np.linalg.solve(design.T @ design + held, design.T @ where[near] + held @ known)[0])
    return np.array(found).reshape(-1, 2)


def _grown(uv: Array, level: Array, shade: Array, start: dict[Place, int], steps: Array) -> dict[Place, int]:
    """Spots by their places, from those at the start outward, the surest link first, so that a stray spot finds its
    place taken."""
    at = dict(start)
    taken = np.zeros(len(uv), bool)
    taken[list(at.values())] = True
    frames = dict.fromkeys(at, steps)
    heap: list[tuple[float, int, Place]] = []
    log_level = np.log(level)

    def look(target: Place) -> tuple[float, int, Array] | None:
        """How far from expected the best spot for a place lies, in shares of what is allowed, which it is, and the
        steps there."""
        expected, local, neighbours = _expected(uv, at, target, frames)
        off = uv - expected
        near = np.flatnonzero((np.abs(off).max(axis=1) < MOST_STEP * OFF_STEP) & ~taken)
        if len(near) == 0:
            return None
        away = np.hypot(*np.linalg.solve(local.T, off[near].T)) / OFF_STEP
        unlike = np.abs(log_level[near] - np.median(log_level[neighbours])) / np.log(UNLIKE)
        around = float(np.median(shade[neighbours]))
        change = np.abs(shade[near] - around) / np.maximum(np.maximum(shade[near], around), 40.0)
        cost = np.where((away < 1) & (unlike < 1) & (change < OFF_SHADE), away + 0.5 * unlike, np.inf)
        best = int(np.argmin(cost))
        return (float(cost[best]), int(near[best]), local) if np.isfinite(cost[best]) else None

    def offer(place: Place) -> None:
        for dr, dc in NEAR_BY:
            target = (place[0] + dr, place[1] + dc)
            if target not in at:
                found = look(target)
                if found is not None:
                    heapq.heappush(heap, (found[0] + 0.3 * (abs(dr) + abs(dc) - 1), found[1], target))

    for place in list(at):
        offer(place)
    while heap:
        cost, spot, target = heapq.heappop(heap)
        if target in at or taken[spot]:
            continue
        again = look(target)
        if again is None:
            continue
        if again[1] != spot or again[0] > cost + 0.25:
            heapq.heappush(heap, (max(again[0], cost), again[1], target))
            continue
        at[target], taken[spot], frames[target] = spot, True, again[2]
        offer(target)
    return at


def _expected(
    uv: Array, at: dict[Place, int], target: Place, frames: dict[Place, Array]
) -> tuple[Array, Array, list[int]]:
    """Where a place's dot is expected (2,): on the smooth surface through the settled dots near it, whose steps are
    held to those of the nearest one; the steps (2, 2) there; and the nearest dots."""
    r, c = target
    spots, here = [], []
    for dr, dc in WINDOW:
        spot = at.get((r + dr, c + dc))
        if spot is not None:
            spots.append(spot)
            here.append((dc, dr))
    steps = frames[r + here[0][1], c + here[0][0]]
    x, y = np.array(here, float).T
    long, high = np.hypot(*steps.T)
    size = min(long, high)
    weight = 1 / (PLACE_SIGMA * size * (0.5 + np.hypot(x, y))) ** 2
    design = np.column_stack([np.ones(len(x)), x, y, x * x, x * y, y * y])
    prior = (
        np.array([np.inf, *[STEP_SIGMA * long, STEP_SIGMA * high], *np.array([long, size, high]) * BEND_SIGMA]) ** -2
    )
    known = np.zeros((6, 2))
    known[1:3] = steps
    normal = design.T @ (design * weight[:, None])
    normal[np.diag_indices(6)] += prior
    fit = np.linalg.solve(normal, design.T @ (uv[spots] * weight[:, None]) + prior[:, None] * known)
    return fit[0], fit[1:3], spots[:4]


def _mean_steps(uv: Array, at: dict[Place, int], known: Array | None = None) -> Array:
    """Median steps (2, 2) to the next column and to the next row."""
    found = []
    for index, (dr, dc) in enumerate(((0, 1), (1, 0))):
        seen = [uv[at[r + dr, c + dc]] - uv[spot] for (r, c), spot in at.items() if (r + dr, c + dc) in at]
        found.append(np.median(seen, axis=0) if seen or known is None else known[index])
    return np.array(found)


def _turned(steps: Array) -> tuple[Array, Array, Indices]:
    """The steps (2, 2) as (right, down): the one that lies more across the image goes right, the other one down; and
    what (2, 2) turns (row, column) along the given steps into (row, column) along these."""
    slope = np.abs(steps[:, 1]) / np.hypot(*steps.T)
    swapped = bool(slope[0] > slope[1])
    across, along = (steps[1], steps[0]) if swapped else (steps[0], steps[1])
    signs = (1 if along[1] >= 0 else -1, 1 if across[0] >= 0 else -1)  # of row, column
    turned = np.array([[0, signs[1]], [signs[0], 0]] if swapped else [[signs[0], 0], [0, signs[1]]], np.int64)
    return across * signs[1], along * signs[0], turned


def _held(uv: Array, at: dict[Place, int]) -> dict[Place, int]:
    """Those with at least two neighbours, one of them in a line of three evenly spaced dots or at a corner of a
    square."""
    while True:
        kept = {}
        for (r, c), spot in at.items():
            here = uv[spot]
            count = even = 0
            for dr, dc in ROUND_ABOUT:
                one, two = at.get((r + dr, c + dc)), at.get((r + 2 * dr, c + 2 * dc))
                count += one is not None
                if one is not None and two is not None:
                    bend = uv[two] - 2 * uv[one] + here
                    even += bool(np.hypot(*bend) < 0.3 * np.hypot(*(uv[one] - here)))
            if count >= 2 and even >= 1:
                kept[r, c] = spot
        if len(kept) == len(at):
            return kept
        at = kept
