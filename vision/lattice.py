"""Gives rows and columns to dots of one image alone, by growing the lattice they form; for photographs without a rig.

The lattice may lie at any angle, bend and widen with the surface: every dot is expected where a smooth curve through
its settled neighbours leads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.lattice_kernels import SIDE, expect, grow
from vision.lattice_seeds import frames_of, reduced

Array = NDArray[Any]  # of floats
Indices = NDArray[np.int64]
Place = tuple[int, int]

NO_FAINTER = 0.5  # than half of its dots: a spot among them that is none of them speaks against a lattice
SEEDS = 40  # spots from which a lattice is grown
ENOUGH = 0.7  # of the light of all spots, in a lattice that needs no rival
ROUND_ABOUT = [(0, 1), (0, -1), (1, 0), (-1, 0)]


@dataclass(frozen=True)
class Lattice:
    """Which spots form it (n,), their rows and columns (n,) counted from zero.

    steps (2, 2): px from one dot to the next column, and to the next row. spacing: px, the lesser of the two. worth: of
    the light that its spots have, and that others have among them."""

    member: Indices
    row: Indices
    column: Indices
    steps: Array
    spacing: float
    worth: float = 0.0

    def __len__(self) -> int:
        return len(self.member)


def find_lattice(uv: Array, level: Array, shade: Array) -> Lattice | None:
    """The worthiest lattice among spots (n, 2), rows counted down and columns to the right as nearly as it lies. None
    with fewer than four dots.

    level (n,): heights of the spots. shade (n,): how bright it is around each; the lattice does not step where that
    changes suddenly, for there the blade ends."""
    if len(uv) < 4:
        return None
    best: dict[Place, int] = {}
    most, frame = 0.0, np.zeros((2, 2))
    used: set[int] = set()
    seeds = sorted(
        (seed for seed in frames_of(uv, level) if seed[0] >= 4),
        key=lambda seed: (-seed[0] * float(np.sqrt(level[seed[1]])), seed[1]),
    )
    light = np.sqrt(level)
    whole = float(light[[seed[1] for seed in seeds]].sum())
    for _, start, steps in seeds[:SEEDS]:
        if start in used:
            continue
        grown = _held(uv, _grown(uv, level, shade, {(0, 0): start}, steps))
        used |= set(grown.values())
        worth = worth_of(uv, level, list(grown.values()))
        if worth > most:
            best, most, frame = grown, worth, steps
            if float(light[list(best.values())].sum()) > ENOUGH * whole:
                break  # most of what lies evenly is in it already
    return lattice_of(uv, level, best, frame) if len(best) >= 4 else None


def worth_of(uv: Array, level: Array, member: list[int]) -> float:
    """Light of a lattice's spots, less that of others among them that are no fainter: dots leave none out."""
    if len(member) < 4:
        return 0.0
    light = np.sqrt(level)
    hull = cv2.convexHull(uv[member].astype(np.float32))
    others = np.setdiff1d(np.flatnonzero(level > NO_FAINTER * np.median(level[member])), member)
    among = [k for k in others.tolist() if cv2.pointPolygonTest(hull, (float(uv[k, 0]), float(uv[k, 1])), False) > 0]
    return float(light[member].sum() - light[among].sum())


def grown_on(uv: Array, level: Array, shade: Array, lattice: Lattice) -> Lattice:
    """The lattice grown on over further spots: its own are the first len(lattice) of uv (n, 2), in its order."""
    start = {(int(r), int(c)): k for k, (r, c) in enumerate(zip(lattice.row, lattice.column, strict=True))}
    steps = _mean_steps(uv, start)
    grown = _held(uv, _grown(uv, level, shade, start, steps))
    return lattice_of(uv, level, grown, steps) if len(grown) >= 4 else lattice


def kept(uv: Array, level: Array, lattice: Lattice, which: NDArray[np.bool_]) -> Lattice | None:
    """What is left of a lattice with only some (n,) of its dots; None where that is none."""
    parts = zip(
        lattice.row[which].tolist(), lattice.column[which].tolist(), lattice.member[which].tolist(), strict=True
    )
    at = _held(uv, {(r, c): spot for r, c, spot in parts})
    return lattice_of(uv, level, at, lattice.steps) if len(at) >= 4 else None


def between(uv: Array, lattice: Lattice) -> Array:
    """Middles (m, 2) px of the cells whose four corners all have dots."""
    at = {(int(r), int(c)): uv[m] for r, c, m in zip(lattice.row, lattice.column, lattice.member, strict=True)}
    cells = [[(r, c), (r + 1, c), (r, c + 1), (r + 1, c + 1)] for r, c in at]
    middles = [np.mean([at[corner] for corner in cell], axis=0) for cell in cells if all(k in at for k in cell)]
    return np.array(middles).reshape(-1, 2)


def lattice_of(uv: Array, level: Array, at: dict[Place, int], steps: Array) -> Lattice:
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
    worth = worth_of(uv, level, member.tolist())
    return Lattice(member, place[:, 0], place[:, 1], np.stack([right, down]), spacing, worth)


def onward(uv: Array, lattice: Lattice) -> Array:
    """Where the lattice of spots (n, 2) would go on but does not: next to its dots, (m, 2) px."""
    at = {(int(r), int(c)): int(m) for r, c, m in zip(lattice.row, lattice.column, lattice.member, strict=True)}
    free = sorted({(r + dr, c + dc) for r, c in at for dr, dc in ROUND_ABOUT} - set(at))
    table, frames, origin = _table(at, lattice.steps)
    fit, near, found = np.zeros((3, 2)), np.zeros(4, np.int32), []
    for place in free:
        row, column = place[0] + origin[0], place[1] + origin[1]
        if 0 <= row < SIDE and 0 <= column < SIDE and expect(uv, table, frames, row, column, fit, near):
            found.append(fit[0].copy())
    return np.array(found).reshape(-1, 2)


def _table(at: dict[Place, int], steps: Array) -> tuple[NDArray[np.int32], Array, Place]:
    """Places as a table, the steps at each, and what is added to a place to find it there."""
    places = np.array(list(at))
    row, column = (SIDE // 2 - (places.min(axis=0) + places.max(axis=0)) // 2).tolist()
    table = np.full((SIDE, SIDE), -1, np.int32)
    for (r, c), spot in at.items():
        if 0 <= r + row < SIDE and 0 <= c + column < SIDE:
            table[r + row, c + column] = spot
    return table, np.broadcast_to(steps, (SIDE, SIDE, 2, 2)).copy(), (row, column)


def _grown(uv: Array, level: Array, shade: Array, start: dict[Place, int], steps: Array) -> dict[Place, int]:
    """Spots by their places, grown from those at the start."""
    table, frames, (row, column) = _table(start, steps)
    grow(np.ascontiguousarray(uv, float), np.log(level), np.ascontiguousarray(shade, float), table, frames)
    rows, columns = np.nonzero(table >= 0)
    return {(r - row, c - column): int(table[r, c]) for r, c in zip(rows.tolist(), columns.tolist(), strict=True)}


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
    """Those with at least two neighbours, or one and two more at their corners, and a neighbour in a line of three
    evenly spaced dots."""
    while True:
        kept = {}
        for (r, c), spot in at.items():
            here = uv[spot]
            count = even = 0
            corners = sum((r + dr, c + dc) in at for dr in (-1, 1) for dc in (-1, 1))
            for dr, dc in ROUND_ABOUT:
                one, two = at.get((r + dr, c + dc)), at.get((r + 2 * dr, c + 2 * dc))
                count += one is not None
                if one is not None and two is not None:
                    bend = uv[two] - 2 * uv[one] + here
                    even += bool(np.hypot(*bend) < 0.3 * np.hypot(*(uv[one] - here)))
            if (count >= 2 or (count == 1 and corners >= 2)) and even >= 1:
                kept[r, c] = spot
        if len(kept) == len(at):
            return kept
        at = kept
