"""Gives rows and columns to dots of one image alone, by walking the lattice they form; for photographs without a
rig."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # of floats
Indices = NDArray[np.int64]

LEAST_STEP, MOST_STEP = 24.0, 110.0  # px between neighbouring dots
OFF_SHADE = 0.45  # by which the brightness around neighbouring dots may differ
OFF_STEP = 0.21  # of the spacing: how far from where its neighbours expect it a dot may lie


@dataclass(frozen=True)
class Lattice:
    """Which spots form it (n,), their rows and columns (n,) counted from zero, and where it would go on but does not
    (m, 2).

    spacing: px between neighbouring dots."""

    member: Indices
    row: Indices
    column: Indices
    absent: Array
    spacing: float


def find_lattice(uv: Array, level: Array, shade: Array) -> Lattice | None:
    """The largest lattice among spots (n, 2); its rows run within 25° of the image's. None with fewer than four dots.

    level (n,): heights of the spots. shade (n,): how bright it is around each; the lattice does not step where that
    changes suddenly, for there the blade ends."""
    steps = _steps(uv, level)
    if steps is None:
        return None
    best: dict[int, tuple[int, int]] = {}
    used: set[int] = set()
    for start in np.argsort(-level, kind="stable").tolist():
        if start in used:
            continue
        walked = _walk(uv, shade, start, *steps)
        used |= set(walked)
        if len(walked) > len(best):
            best = walked
    if len(best) < 4:
        return None
    member = np.array(sorted(best))
    place = np.array([best[k] for k in member])
    place -= place.min(axis=0)
    absent = _absent(uv[member], place, *steps)
    spacing = float(min(np.hypot(*steps[0]), np.hypot(*steps[1])))
    return Lattice(member, place[:, 0], place[:, 1], absent, spacing)


def _steps(uv: Array, level: Array) -> tuple[Array, Array] | None:
    """The vectors (right, down) from a dot to its neighbours that occur most."""
    strong = uv[np.argsort(-level, kind="stable")[:150]]
    apart = (strong[None] - strong[:, None]).reshape(-1, 2)
    length = np.hypot(apart[:, 0], apart[:, 1])
    near = (length > LEAST_STEP) & (length < MOST_STEP)
    found = []
    for axis in (0, 1):
        along, across = apart[:, axis], apart[:, 1 - axis]
        vectors = apart[near & (along > 0) & (np.abs(across) < 0.47 * along)]
        if len(vectors) < 4:
            return None
        close = np.hypot(*(vectors[:, None] - vectors[None]).transpose(2, 0, 1))
        size = np.hypot(vectors[:, 0], vectors[:, 1])
        votes = (close < 0.14 * size[:, None]).sum(axis=1) / size
        best = int(np.argmax(votes))
        found.append(np.median(vectors[close[best] < 0.14 * size[best]], axis=0))
    return found[0], found[1]


def _walk(uv: Array, shade: Array, start: int, right: Array, down: Array) -> dict[int, tuple[int, int]]:
    """Spots reached from one by steps right, left, down and up, with their places: the surest link first, so that a
    stray spot finds its place taken. Steps adapt as they go, for the spacing changes over a slanting surface."""
    place: dict[int, tuple[int, int]] = {}
    at: dict[tuple[int, int], int] = {}
    local: dict[int, tuple[Array, Array]] = {}
    heap: list[tuple[float, int, int, tuple[int, int], tuple[Array, Array]]] = []
    serial = 0

    def settle(spot: int, target: tuple[int, int], vectors: tuple[Array, Array]) -> None:
        nonlocal serial
        place[spot], at[target], local[spot] = target, spot, vectors
        for way, sign in ((1, 1), (1, -1), (0, 1), (0, -1)):
            vector = vectors[0 if way == 1 else 1]
            step = (0, sign) if way == 1 else (sign, 0)
            onward = (target[0] + step[0], target[1] + step[1])
            distance = np.hypot(*(uv - (uv[spot] + sign * vector)).T)
            nearest = int(np.argmin(distance))
            share = float(distance[nearest] / np.hypot(*vector))
            change = abs(shade[nearest] - shade[spot]) / max(shade[nearest], shade[spot], 40.0)
            if onward in at or share > OFF_STEP or nearest == spot or change > OFF_SHADE:
                continue
            seen = sign * (uv[nearest] - uv[spot])
            adapted = seen + 0.4 * (seen - vector)
            changed = (adapted, vectors[1]) if way == 1 else (vectors[0], adapted)
            serial += 1
            heapq.heappush(heap, (share, serial, nearest, onward, changed))

    settle(start, (0, 0), (right, down))
    while heap:
        _, _, spot, target, vectors = heapq.heappop(heap)
        if spot not in place and target not in at:
            settle(spot, target, vectors)
    return _held(uv, place)


def _held(uv: Array, place: dict[int, tuple[int, int]]) -> dict[int, tuple[int, int]]:
    """Those with at least two neighbours, one of them in a line of three evenly spaced dots or at a corner of a
    square."""
    while True:
        at = {target: spot for spot, target in place.items()}
        kept = {}
        for spot, (r, c) in place.items():
            here = uv[spot]
            count = even = 0
            for dr, dc in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                one, two = at.get((r + dr, c + dc)), at.get((r + 2 * dr, c + 2 * dc))
                count += one is not None
                if one is not None and two is not None:
                    bend = uv[two] - 2 * uv[one] + here
                    even += bool(np.hypot(*bend) < 0.27 * np.hypot(*(uv[one] - here)))
            if count >= 2 and even >= 1:
                kept[spot] = (r, c)
        if len(kept) == len(place):
            return kept
        place = kept


def _absent(uv: Array, place: Indices, right: Array, down: Array) -> Array:
    """Places next to the lattice's dots where none is, by extrapolation from two dots in a line where there are two."""
    at = {(int(r), int(c)): uv[k] for k, (r, c) in enumerate(place)}
    found: dict[tuple[int, int], Array] = {}
    for (r, c), here in at.items():
        for dr, dc, step in ((0, 1, right), (0, -1, -right), (1, 0, down), (-1, 0, -down)):
            target = (r + dr, c + dc)
            if target in at or target in found:
                continue
            before = at.get((r - dr, c - dc))
            found[target] = here + (here - before if before is not None else step)
    return np.array(list(found.values())).reshape(-1, 2)
