"""Where a lattice of dots may begin: spots with others evenly around them, and the steps to those."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vision.lattice_kernels import UNLIKE

Array = NDArray[Any]  # of floats

LEAST_STEP, MOST_STEP = 12.0, 64.0  # px between neighbouring dots
MOST_STEPS = 10  # shortest steps to a spot's neighbours of which two are tried together
PAIRS = np.triu_indices(MOST_STEPS, 1)
SYMMETRIC = 0.17  # of a step: how unequal the steps to both sides of a dot may be


def frames_of(uv: Array, level: Array) -> list[tuple[int, int, Array]]:
    """(score, spot, steps (2, 2)) of spots that have others evenly around them, best first: the shortest two steps
    that lead to others on both sides, and how many of the eight places around are taken."""
    tree = cKDTree(uv)
    found = []
    nearby: Any = tree.query_ball_point(uv, MOST_STEP)
    for spot, near in enumerate(nearby):
        others = np.array([k for k in near if k != spot], np.int64)
        if len(others) < 3:
            continue
        likeness = np.abs(np.log(level[others] / level[spot])) < np.log(UNLIKE)
        step = (uv[others] - uv[spot])[likeness]
        length = np.hypot(step[:, 0], step[:, 1])
        step, length = step[length > LEAST_STEP], length[length > LEAST_STEP]
        if len(step) < 3:
            continue
        miss = np.hypot(*(-step[:, None] - step[None]).transpose(2, 0, 1)).min(axis=1)
        half = step[:, 0] + 0.4 * step[:, 1] > -0.2 * length  # one of each opposite two, or both
        order = np.flatnonzero(half & (miss < 2 * SYMMETRIC * length))
        order = order[np.argsort(length[order], kind="stable")][:MOST_STEPS]
        best = _best_frame(step, order, length[order])
        if best is not None:
            found.append((best[1], spot, reduced(best[2])))
    return sorted(found, key=lambda frame: (-frame[0], frame[1]))


def _best_frame(step: Array, order: NDArray[np.int64], length: Array) -> tuple[float, int, Array] | None:
    """(worth, score, steps (2, 2)) of the best two of the steps `order` out of step (n, 2) that are nearly square to
    each other, None where no two are; length: of those in order."""
    inside = PAIRS[1] < len(order)
    i, j = PAIRS[0][inside], PAIRS[1][inside]
    a, b = step[order[i]], step[order[j]]
    cross = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    good = (cross >= 0.7 * length[i] * length[j]) & (length[j] <= 2.5 * length[i])
    if not good.any():
        return None
    a, b, short, long = a[good], b[good], length[i][good], length[j][good]
    ring = np.stack([a, -a, b, -b, a + b, a - b, b - a, -a - b], axis=1)
    off = ring[:, :, None] - step
    hit = (off * off).sum(axis=3).min(axis=2)
    score = (hit < (SYMMETRIC * 1.5 * short[:, None]) ** 2).sum(axis=1)
    # Steps over two dots find dots as well: a shorter frame is the better one unless it misses much.
    worth = score - 1.5 * np.log2(short * long / LEAST_STEP**2)
    best = int(worth.argmax())
    return float(worth[best]), int(score[best]), np.stack([a[best], b[best]])


def reduced(steps: Array) -> Array:
    """The two shortest steps (2, 2) of the same lattice: rows and columns, not rows and diagonals."""
    one, two = steps[np.argsort(np.hypot(*steps.T), kind="stable")]
    while True:
        two = two - np.rint(float(two @ one) / float(one @ one)) * one
        if np.hypot(*two) >= np.hypot(*one) * (1 - 1e-9):
            return np.stack([one, two])
        one, two = two, one
