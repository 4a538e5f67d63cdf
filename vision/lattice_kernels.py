"""Inner loops that grow a lattice of dots from place to place."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]
Table = NDArray[np.int32]

SIDE = 61  # places of a table to each side; a lattice that starts in its middle has room for 30 rows each way
OFF_STEP = 0.2  # of the spacing: how far from where its neighbours expect it a dot may lie
SAME_SHADE = 0.3  # by which the brightness around neighbouring dots may differ without a doubt
DOUBT = 1.5  # how much less far off a dot may lie where it differs by more: there the blade may end, or a shadow begin
DARK = 40.0  # grey levels below which shades are compared with this
UNLIKE = 4.0  # times as bright as its neighbours a dot may be
STEP_SIGMA, BEND_SIGMA, PLACE_SIGMA = 0.15, 0.1, 0.02  # of the spacing: what is known of the next dot beforehand
MOST_WAITING = 20000  # offers at one time
WINDOW = np.array(  # places around one, the nearest first
    sorted(
        ((dr, dc) for dr in range(-3, 4) for dc in range(-3, 4) if 0 < dr * dr + dc * dc <= 10),
        key=lambda d: (d[0] ** 2 + d[1] ** 2, d),
    ),
    np.int64,
)
NEAR_BY = np.array(
    [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1), (0, 2), (0, -2), (2, 0), (-2, 0)]
)


@compiled
def expect(uv: Floats, table: Table, frames: Floats, row: int, column: int, fit: Floats, near: Table) -> int:
    """Where a place's dot is expected, on the smooth surface through the settled dots near it, whose steps are held to
    those of the nearest one: fit (3, 2) = the place, the steps to the next column and to the next row. near (4,): the
    nearest dots; returned: how many."""
    normal, right = np.zeros((6, 6)), np.zeros((6, 2))
    term = np.empty(6)
    count, long, high, size = 0, 0.0, 0.0, 0.0
    steps = np.zeros((2, 2))
    for w in range(len(WINDOW)):
        dr, dc = WINDOW[w]
        r, c = row + dr, column + dc
        if r < 0 or c < 0 or r >= SIDE or c >= SIDE or table[r, c] < 0:
            continue
        spot = table[r, c]
        if count == 0:
            steps[:] = frames[r, c]
            long, high = np.hypot(steps[0, 0], steps[0, 1]), np.hypot(steps[1, 0], steps[1, 1])
            size = min(long, high)
        if count < 4:
            near[count] = spot
        count += 1
        term[0], term[1], term[2], term[3], term[4], term[5] = 1.0, dc, dr, dc * dc, dc * dr, dr * dr
        weight = 1 / (PLACE_SIGMA * size * (0.5 + np.hypot(dr, dc))) ** 2
        for i in range(6):
            for j in range(i + 1):
                normal[i, j] += weight * term[i] * term[j]
            right[i, 0] += weight * term[i] * uv[spot, 0]
            right[i, 1] += weight * term[i] * uv[spot, 1]
    if count == 0:
        return 0
    held = (STEP_SIGMA * long, STEP_SIGMA * high, BEND_SIGMA * long, BEND_SIGMA * size, BEND_SIGMA * high)
    for i in range(5):
        normal[i + 1, i + 1] += 1 / held[i] ** 2
    for i in range(2):
        for k in range(2):
            right[i + 1, k] += steps[i, k] / held[i] ** 2
    for j in range(6):
        total = normal[j, j]
        for k in range(j):
            total -= normal[j, k] ** 2
        normal[j, j] = np.sqrt(max(total, 1e-12))
        for i in range(j + 1, 6):
            total = normal[i, j]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = total / normal[j, j]
    for axis in range(2):
        for i in range(6):
            total = right[i, axis]
            for k in range(i):
                total -= normal[i, k] * right[k, axis]
            right[i, axis] = total / normal[i, i]
        for i in range(5, -1, -1):
            total = right[i, axis]
            for k in range(i + 1, 6):
                total -= normal[k, i] * right[k, axis]
            right[i, axis] = total / normal[i, i]
    fit[:] = right[:3]
    return count


@compiled
def _median_at(values: Floats, which: Table, count: int) -> float:
    """The median of at most four values."""
    low, high, total = np.inf, -np.inf, 0.0
    for k in range(count):
        value = values[which[k]]
        low, high, total = min(low, value), max(high, value), total + value
    middle: float = total / max(count, 1) if count < 3 else (total - low - high) / (count - 2)
    return middle


@compiled
def _fittest(
    uv: Floats, log_level: Floats, shade: Floats, taken: NDArray[np.bool_], fit: Floats, near: Table, count: int
) -> tuple[float, int]:
    """How far from expected the best free spot for a place lies, in shares of what is allowed, and which it is; -1 for
    none. count: of the nearest dots, at most four."""
    typical, around = _median_at(log_level, near, count), _median_at(shade, near, count)
    determinant = fit[1, 0] * fit[2, 1] - fit[1, 1] * fit[2, 0]
    if abs(determinant) < 1e-6:
        return np.inf, -1
    reach = OFF_STEP * (np.abs(fit[1]).max() + np.abs(fit[2]).max())
    best, chosen = np.inf, -1
    for k in range(len(uv)):
        x, y = uv[k, 0] - fit[0, 0], uv[k, 1] - fit[0, 1]
        if taken[k] or abs(x) > reach or abs(y) > reach:
            continue
        along, down = (x * fit[2, 1] - y * fit[2, 0]) / determinant, (y * fit[1, 0] - x * fit[1, 1]) / determinant
        away = np.hypot(along, down) / OFF_STEP
        unlike = abs(log_level[k] - typical) / np.log(UNLIKE)
        change = abs(shade[k] - around) / max(shade[k], around, DARK)
        away += DOUBT * max(change - SAME_SHADE, 0.0)
        if away < 1 and unlike < 1 and away + 0.5 * unlike < best:
            best, chosen = away + 0.5 * unlike, k
    return best, chosen


@compiled
def grow(uv: Floats, log_level: Floats, shade: Floats, table: Table, frames: Floats) -> None:
    """Put spots (n, 2) into the free places (-1) of table (SIDE, SIDE), from those in it outward, the surest link
    first, so that a stray spot finds its place taken. frames (SIDE, SIDE, 2, 2): the steps at each settled place."""
    taken = np.zeros(len(uv), np.bool_)
    fit, near = np.zeros((3, 2)), np.zeros(4, np.int32)
    costs, offers = np.empty(MOST_WAITING), np.empty((MOST_WAITING, 3), np.int32)
    waiting = 0
    fresh, news = np.empty((SIDE * SIDE, 2), np.int32), 0
    for r in range(SIDE):
        for c in range(SIDE):
            if table[r, c] >= 0:
                taken[table[r, c]] = True
                fresh[news, 0], fresh[news, 1] = r, c
                news += 1
    while True:
        for n in range(news):
            for k in range(len(NEAR_BY)):
                dr, dc = NEAR_BY[k]
                r, c = fresh[n, 0] + dr, fresh[n, 1] + dc
                if r < 0 or c < 0 or r >= SIDE or c >= SIDE or table[r, c] >= 0 or waiting >= MOST_WAITING:
                    continue
                count = min(expect(uv, table, frames, r, c, fit, near), 4)
                cost, spot = _fittest(uv, log_level, shade, taken, fit, near, count)
                if spot >= 0:
                    costs[waiting] = cost + 0.3 * (abs(dr) + abs(dc) - 1)
                    offers[waiting, 0], offers[waiting, 1], offers[waiting, 2] = spot, r, c
                    waiting += 1
        news = 0
        if waiting == 0:
            return
        first = 0
        for n in range(1, waiting):
            if costs[n] < costs[first]:
                first = n
        cost, spot, r, c = costs[first], offers[first, 0], offers[first, 1], offers[first, 2]
        waiting -= 1
        costs[first] = costs[waiting]
        offers[first] = offers[waiting]
        if table[r, c] >= 0 or taken[spot]:
            continue
        count = min(expect(uv, table, frames, r, c, fit, near), 4)
        again, same = _fittest(uv, log_level, shade, taken, fit, near, count)
        if same < 0:
            continue
        if same != spot or again > cost + 0.25:
            costs[waiting] = max(again, cost)
            offers[waiting, 0], offers[waiting, 1], offers[waiting, 2] = same, r, c
            waiting += 1
            continue
        table[r, c], taken[spot] = spot, True
        frames[r, c] = fit[1:]
        fresh[0, 0], fresh[0, 1], news = r, c, 1
