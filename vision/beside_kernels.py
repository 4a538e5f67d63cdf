"""Inner loops over the dots that lie beside lines, and over the places of a line beside which they lie."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]


@compiled
def shares_beyond(dots: Floats, normals: Floats, rhos: Floats, past_px: float) -> Floats:
    """Share (k,) of the dots (n, 2) that lie more than past_px past each of k lines, along its normal (k, 2)."""
    share = np.empty(len(rhos))
    for line in range(len(rhos)):
        nx, ny, limit, count = normals[line, 0], normals[line, 1], rhos[line] + past_px, 0
        for k in range(len(dots)):
            count += dots[k, 0] * nx + dots[k, 1] * ny > limit
        share[line] = count / len(dots)
    return share


@compiled
def stretches_beside(dots: Floats, normals: Floats, few: int, low: Floats, high: Floats) -> None:
    """The stretch (low, high) (k,) of each line that has dots (n, 2) beside it, but for a `few` at either end."""
    least, most = np.empty(few + 1), np.empty(few + 1)
    for line in range(len(normals)):
        nx, ny = normals[line, 0], normals[line, 1]
        for k in range(len(dots)):
            along = dots[k, 1] * nx - dots[k, 0] * ny
            if k <= few or along < least[few]:
                place = min(k, few)
                while place > 0 and least[place - 1] > along:
                    least[place] = least[place - 1]
                    place -= 1
                least[place] = along
            if k <= few or along > most[few]:
                place = min(k, few)
                while place > 0 and most[place - 1] < along:
                    most[place] = most[place - 1]
                    place -= 1
                most[place] = along
        low[line], high[line] = least[few], most[few]


@compiled
def outermost(dots: Floats, normals: Floats, but: int) -> Floats:
    """How far out (k,) along each normal (k, 2) the dots (n, 2) reach, `but` so many of them left out."""
    most, reach = np.empty(but + 1), np.empty(len(normals))
    for line in range(len(normals)):
        nx, ny = normals[line, 0], normals[line, 1]
        for k in range(len(dots)):
            out = dots[k, 0] * nx + dots[k, 1] * ny
            if k <= but or out > most[but]:
                place = min(k, but)
                while place > 0 and most[place - 1] < out:
                    most[place] = most[place - 1]
                    place -= 1
                most[place] = out
        reach[line] = most[but]
    return reach


@compiled
def shares_agreeing(t: Floats, agrees: NDArray[np.bool_], low: Floats, high: Floats, fewest: int) -> Floats:
    """Share (k,) of the places t (k, m) of each line between low and high (k,) at which its step is there; of all
    places where fewer than `fewest` lie there."""
    share = np.empty(len(t))
    for line in range(len(t)):
        inside, there, all_there = 0, 0, 0
        for m in range(t.shape[1]):
            within = low[line] < t[line, m] < high[line]
            inside += within
            there += within and agrees[line, m]
            all_there += agrees[line, m]
        share[line] = there / inside if inside >= fewest else all_there / t.shape[1]
    return share


@compiled
def highest(values: Floats, but: int) -> Floats:
    """The highest (k,) of values (k, n), `but` so many of them left out."""
    most, found = np.empty(but + 1), np.empty(len(values))
    for row in range(len(values)):
        for k in range(values.shape[1]):
            value = values[row, k]
            if k <= but or value > most[but]:
                place = min(k, but)
                while place > 0 and most[place - 1] < value:
                    most[place] = most[place - 1]
                    place -= 1
                most[place] = value
        found[row] = most[but]
    return found
