"""Where a lattice of dots may begin: spots with others evenly around them, and the steps to those."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vision.lattice_kernels import UNLIKE

Array = NDArray[Any]  # of floats

LEAST_STEP, MOST_STEP = 12.0, 64.0  # px between neighbouring dots
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
        order = order[np.argsort(length[order], kind="stable")][:12]
        best: tuple[float, int, Array] | None = None
        for n, i in enumerate(order):
            for j in order[n + 1 :]:
                a, b = step[i], step[j]
                if abs(a[0] * b[1] - a[1] * b[0]) < 0.7 * length[i] * length[j] or length[j] > 2.5 * length[i]:
                    continue
                ring = np.array([a, -a, b, -b, a + b, a - b, b - a, -a - b])
                hit = np.hypot(*(ring[:, None] - step[None]).transpose(2, 0, 1)).min(axis=1)
                score = int((hit < SYMMETRIC * 1.5 * length[i]).sum())
                # Steps over two dots find dots as well: a shorter frame is the better one unless it misses much.
                worth = score - 1.5 * np.log2(length[i] * length[j] / LEAST_STEP**2)
                if best is None or worth > best[0]:
                    best = (worth, score, np.stack([a, b]))
        if best is not None:
            found.append((best[1], spot, reduced(best[2])))
    return sorted(found, key=lambda frame: (-frame[0], frame[1]))


def reduced(steps: Array) -> Array:
    """The two shortest steps (2, 2) of the same lattice: rows and columns, not rows and diagonals."""
    one, two = steps[np.argsort(np.hypot(*steps.T), kind="stable")]
    while True:
        two = two - np.rint(float(two @ one) / float(one @ one)) * one
        if np.hypot(*two) >= np.hypot(*one) * (1 - 1e-9):
            return np.stack([one, two])
        one, two = two, one
