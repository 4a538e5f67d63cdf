"""Inner loops of the matching: pairs that meet in a point on a laser ray, and the surfaces that such points form."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Array = NDArray[Any]  # of floats
Indices = NDArray[np.int64]


@compiled
def pairs(
    rays: Array, other_rays: Array, other_eye: Array, most_miss: float, least_w: float, most_w: float,
    sigma_left: Array, sigma_right: Array, to_laser: Array, laser_position: Array, tangents: Array, size: Indices,
    off_grid: float, index: Indices, value: Array,
) -> int:  # fmt: skip
    """Pairs of rays (n, 3) and other_rays (m, 3), x = 1, both in the left camera's axes, the others from other_eye
    (3,), that meet in front of the lens at a whole row and column of the laser.

    to_laser (3, 3), laser_position (3,), tangents (2,) of half the fan across and down, size (2,) rows and columns.
    Written: index (k, 4) = left, right, row, column; value (k, 3) = inverse depth 1/m, its sigma, misfit; returned: k,
    -1 if there is no room."""
    count = 0
    for j in range(len(other_rays)):
        y, z = other_rays[j, 1] / other_rays[j, 0], other_rays[j, 2] / other_rays[j, 0]
        lever_y, lever_z = other_eye[1] - y * other_eye[0], other_eye[2] - z * other_eye[0]
        lever = max(np.sqrt(lever_y * lever_y + lever_z * lever_z), 1e-9)
        lever_y, lever_z = lever_y / lever, lever_z / lever
        for i in range(len(rays)):
            apart_y, apart_z = rays[i, 1] - y, rays[i, 2] - z
            if abs(apart_y * lever_z - apart_z * lever_y) > most_miss:
                continue
            w = (apart_y * lever_y + apart_z * lever_z) / lever
            if not least_w < w < most_w:
                continue
            px, py, pz = (
                1 / w - laser_position[0],
                rays[i, 1] / w - laser_position[1],
                rays[i, 2] / w - laser_position[2],
            )
            ahead = to_laser[0, 0] * px + to_laser[0, 1] * py + to_laser[0, 2] * pz
            if ahead <= 0:
                continue
            across = (to_laser[1, 0] * px + to_laser[1, 1] * py + to_laser[1, 2] * pz) / ahead / tangents[0]
            down = (to_laser[2, 0] * px + to_laser[2, 1] * py + to_laser[2, 2] * pz) / ahead / tangents[1]
            row, column = (down + 1) / 2 * (size[0] - 1), (across + 1) / 2 * (size[1] - 1)
            whole_row, whole_column = np.floor(row + 0.5), np.floor(column + 0.5)
            misfit = np.sqrt((row - whole_row) ** 2 + (column - whole_column) ** 2)
            if misfit >= off_grid or not (0 <= whole_row < size[0] and 0 <= whole_column < size[1]):
                continue
            if count == len(index):
                return -1
            index[count, 0], index[count, 1] = i, j
            index[count, 2], index[count, 3] = int(whole_row), int(whole_column)
            value[count, 0] = w
            value[count, 1] = np.sqrt(sigma_left[i] ** 2 + sigma_right[j] ** 2) / lever
            value[count, 2] = misfit
            count += 1
    return count


@compiled
def _root(parent: Indices, k: int) -> int:
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@compiled
def components(
    row: Indices, column: Indices, w: Array, sigma: Array, rows: int, columns: int, reach: int, relief: float,
    label: Indices,
) -> int:  # fmt: skip
    """Label (n,) candidates whose neighbours in the grid, up to `reach` away, lie at a like inverse depth w (n,):
    within `relief` of it a step, and four sigma (n,). Returned: number of labels, which count from 0 on."""
    count = len(row)
    parent = np.arange(count)
    first, following = np.full(rows * columns, -1), np.full(count, -1)
    for k in range(count):
        cell = row[k] * columns + column[k]
        following[k], first[cell] = first[cell], k
    for k in range(count):
        for r in range(max(row[k] - reach, 0), min(row[k], rows - 1) + 1):
            for c in range(max(column[k] - reach, 0), min(column[k] + reach, columns - 1) + 1):
                if r == row[k] and c >= column[k]:
                    break
                other = first[r * columns + c]
                steps = max(row[k] - r, abs(column[k] - c))
                while other >= 0:
                    allowed = relief * max(w[k], w[other]) * steps + 4 * np.sqrt(sigma[k] ** 2 + sigma[other] ** 2)
                    if abs(w[k] - w[other]) < allowed:
                        a, b = _root(parent, k), _root(parent, other)
                        parent[max(a, b)] = min(a, b)
                    other = following[other]
    number = 0
    for k in range(count):
        if _root(parent, k) == k:
            label[k] = number
            number += 1
    for k in range(count):
        label[k] = label[_root(parent, k)]
    return number


@compiled
def surfaces(
    index: Indices, weight: Array, misfit: Array, order: Indices, label: Indices, labels: int, cells: int, columns: int,
    least: int, least_misfit: float, surface: Indices,
) -> float:  # fmt: skip
    """Share out candidates among surfaces, the best supported group first: no spot and no ray twice.

    index (n, 4) as of `pairs`, right -1 without one; weight, misfit, label (n,); order (n,): by rising misfit; least:
    dots of a surface; least_misfit: no reading is known to fit better. Written: surface (n,), -1 for what is dropped.
    Returned: support of the best reading that contradicts the first surface, over the first's."""
    count = len(index)
    lefts, rights = 1, 1
    for k in range(count):
        lefts, rights = max(lefts, index[k, 0] + 1), max(rights, index[k, 1] + 1)
    alive = np.ones(count, np.bool_)
    surface[:] = -1
    scores, member_misfit = np.empty(labels), np.empty(count)
    best_left, best_right = np.empty(lefts, np.int64), np.empty(rights, np.int64)
    best_cell, used = np.empty(cells, np.int64), np.zeros(cells, np.bool_)
    rival, number = 0.0, 0
    while True:
        scores[:] = 0
        for k in range(count):
            if alive[k]:
                scores[label[k]] += weight[k]
        best = 0
        for k in range(labels):
            if scores[k] > scores[best]:
                best = k
        if labels == 0 or scores[best] <= 0:
            return rival
        # of several that share a spot or a ray, the one that fits the grid best stays
        best_left[:], best_right[:], best_cell[:] = -1, -1, -1
        members = 0
        for one in order:
            if not alive[one] or label[one] != best:
                continue
            alive[one] = False
            member_misfit[members] = misfit[one]
            members += 1
            cell, spot, right = index[one, 2] * columns + index[one, 3], index[one, 0], index[one, 1]
            if best_left[spot] < 0 and (right < 0 or best_right[right] < 0) and best_cell[cell] < 0:
                best_left[spot] = one
                best_cell[cell] = one
                if right >= 0:
                    best_right[right] = one
        size = 0
        for k in range(count):
            if best_left[index[k, 0]] == k:
                size += 1
        if size < least:
            return rival
        scores[:] = 0
        # how well the best reading fits the grid is what another reading has to equal
        usual = 0.5 * (member_misfit[(members - 1) // 2] + member_misfit[members // 2])
        usual = max(usual / 1.18, least_misfit)
        first = 0.0
        for k in range(count):
            if best_left[index[k, 0]] == k:
                first += np.exp(-0.5 * (misfit[k] / usual) ** 2)
                surface[k] = number
                used[index[k, 2] * columns + index[k, 3]] = True
        for k in range(count):
            if not alive[k]:
                continue
            right = index[k, 1]
            if best_left[index[k, 0]] >= 0 or (right >= 0 and best_right[right] >= 0):
                scores[label[k]] += np.exp(-0.5 * (misfit[k] / usual) ** 2)
                alive[k] = False
            elif used[index[k, 2] * columns + index[k, 3]]:
                alive[k] = False
        if number == 0:
            rival = scores.max() / max(first, 1e-9)
        number += 1


@compiled
def medians(values: Array, label: Indices) -> Array:
    """Median (m,) of the values (n,) of each label, which count from 0 on."""
    number = 0
    for one in label:
        number = max(number, one + 1)
    middle, ordered = np.empty(number), np.empty(len(values))
    for one in range(number):
        count = 0
        for k in range(len(values)):
            if label[k] != one:
                continue
            place = count
            while place > 0 and ordered[place - 1] > values[k]:
                ordered[place] = ordered[place - 1]
                place -= 1
            ordered[place] = values[k]
            count += 1
        middle[one] = 0.5 * (ordered[(count - 1) // 2] + ordered[count // 2]) if count > 0 else np.nan
    return middle
