"""Inner loops that fit Gaussian spots to what the laser added around peaks.

A spot is level · exp(−½ (pxx x² + 2 pxy x y + pyy y²)) + base about its centre; (pxx, pxy, pyy) is its shape.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]

WIDE = 24  # columns that the widest square is made up to, for vectors
CONVERGED_PX = 0.04  # a step of Gauss and Newton that needs no other: the next is its square


@compiled
def _solve(matrix: Floats, right: Floats, count: int, factored: bool) -> None:
    """Solve in place by Cholesky; right (count,) becomes the solution, the lower triangle of matrix its factor, which
    it already is when `factored`."""
    if not factored:
        for j in range(count):
            total = matrix[j, j]
            for k in range(j):
                total -= matrix[j, k] * matrix[j, k]
            matrix[j, j] = np.sqrt(max(total, 1e-12))
            for i in range(j + 1, count):
                total = matrix[i, j]
                for k in range(j):
                    total -= matrix[i, k] * matrix[j, k]
                matrix[i, j] = total / matrix[j, j]
    for i in range(count):
        total = right[i]
        for k in range(i):
            total -= matrix[i, k] * right[k]
        right[i] = total / matrix[i, i]
    for i in range(count - 1, -1, -1):
        total = right[i]
        for k in range(i + 1, count):
            total -= matrix[k, i] * right[k]
        right[i] = total / matrix[i, i]


@compiled
def _equations(
    pixels: Floats, side: int, spot: Floats, shape: Floats, falls: Floats, full: bool, sums: Floats, normal: Floats,
    right: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Normal equations of the residual about a spot (u, v, level, base) in terms of base and the bell times (1, x, y,
    x², xy, y²), in this order, x and y from the spot's centre, the last three only if `full`; returned: weighted
    squares of residuals, their number. falls (3,): exp(-shape).

    pixels (side, 3 · WIDE): signal, weights, and 1 where burnt, weightless from column `side` on. sums (17 · WIDE,):
    float32, room for sums down each column, which are taken side by side and only then put together."""
    reach, wide = side // 2, (side + 7) // 8 * 8
    u, v, level, base = spot[0], spot[1], np.float32(spot[2]), np.float32(spot[3])
    pxx, pxy, pyy = shape[0], shape[1], shape[2]
    sums[:] = 0.0
    none, one = np.float32(0), np.float32(1)
    # the bell in each column's first row, and by how much it falls from there to the next row, and that from row to row
    x, y = -reach - u, -reach - v
    bell, down = (
        np.exp(-0.5 * (pxx * x + 2 * pxy * y) * x - 0.5 * pyy * y * y),
        np.exp(-0.5 * pyy * (2 * y + 1) - pxy * x),
    )
    across, change, turn = np.exp(-0.5 * pxx * (2 * x + 1) - pxy * y), falls[0], falls[1]
    for k in range(side):
        sums[k], sums[WIDE + k] = bell, down
        bell, across, down = bell * across, across * change, down * turn
    fall = np.float32(falls[2])
    for i in range(side):
        y = np.float32(i - reach - v)
        row = pixels[i]
        for k in range(wide):
            light = sums[k]
            residual = row[k] - level * light - base
            weight = none if (row[2 * WIDE + k] > none) & (residual < none) else row[WIDE + k]
            single = weight * light
            both = single * light
            apart = single * residual
            sums[k] = light * sums[WIDE + k]
            sums[WIDE + k] *= fall
            sums[2 * WIDE + k] += weight
            sums[3 * WIDE + k] += single
            sums[4 * WIDE + k] += single * y
            sums[5 * WIDE + k] += both
            sums[6 * WIDE + k] += both * y
            sums[7 * WIDE + k] += both * y * y
            sums[8 * WIDE + k] += weight * residual
            sums[9 * WIDE + k] += apart
            sums[10 * WIDE + k] += apart * y
            sums[11 * WIDE + k] += weight * residual * residual
            sums[12 * WIDE + k] += one if weight > none else none
            if full:
                sums[13 * WIDE + k] += single * y * y
                sums[14 * WIDE + k] += both * y * y * y
                sums[15 * WIDE + k] += both * y * y * y * y
                sums[16 * WIDE + k] += apart * y * y
    normal[:] = 0.0
    right[:] = 0.0
    misfit, number = 0.0, 0.0
    for k in range(side):
        x = k - reach - u
        x2 = x * x
        e0, e1, s0, s1, s2 = (
            sums[3 * WIDE + k], sums[4 * WIDE + k], sums[5 * WIDE + k], sums[6 * WIDE + k], sums[7 * WIDE + k],
        )  # fmt: skip
        r0, r1 = sums[9 * WIDE + k], sums[10 * WIDE + k]
        normal[0, 0] += sums[2 * WIDE + k]
        normal[1, 0] += e0
        normal[2, 0] += x * e0
        normal[3, 0] += e1
        normal[1, 1] += s0
        normal[2, 1] += x * s0
        normal[3, 1] += s1
        normal[2, 2] += x2 * s0
        normal[3, 2] += x * s1
        normal[3, 3] += s2
        right[0] += sums[8 * WIDE + k]
        right[1] += r0
        right[2] += x * r0
        right[3] += r1
        misfit += sums[11 * WIDE + k]
        number += sums[12 * WIDE + k]
        if full:
            s3 = sums[14 * WIDE + k]
            normal[4, 0] += x2 * e0
            normal[5, 0] += x * e1
            normal[6, 0] += sums[13 * WIDE + k]
            normal[4, 2] += x2 * x * s0
            normal[5, 2] += x2 * s1
            normal[6, 2] += x * s2
            normal[6, 3] += s3
            normal[4, 4] += x2 * x2 * s0
            normal[5, 4] += x2 * x * s1
            normal[6, 4] += x2 * s2
            normal[6, 5] += x * s3
            normal[6, 6] += sums[15 * WIDE + k]
            right[4] += x2 * r0
            right[5] += x * r1
            right[6] += sums[16 * WIDE + k]
    if full:
        normal[4, 1], normal[5, 1], normal[6, 1] = normal[2, 2], normal[3, 2], normal[3, 3]
        normal[4, 3], normal[5, 3], normal[5, 5] = normal[5, 2], normal[6, 2], normal[6, 4]
    return misfit, number


@compiled
def fit_spots(
    signal: Floats, weights: Floats, burnt: NDArray[np.bool_], usual: Floats, shapes: Floats, free_shape: bool,
    steps: int, found: Floats, quality: Floats,
) -> None:  # fmt: skip
    """Fit a spot to each square by Gauss and Newton, weighting by `weights` (n, p).

    burnt (n, p): pixels that say no more than "at least". usual (3,): the shape all start with, and keep
    unless free_shape. found (n, 4): u, v from the middle, level, base; holds the start. Written besides: shapes (n, 3),
    quality (n, 4) = variances of u, of v, of the level, mean of weighted squared residuals."""
    count, size = signal.shape
    falls = np.empty(3)
    for i in range(3):
        falls[i] = np.exp(-usual[i])
    bound = int(np.sqrt(size) + 0.5) // 2 - 0.5
    unknowns = 7 if free_shape else 4
    side = int(np.sqrt(size) + 0.5)
    normal, right = np.zeros((7, 7)), np.zeros(7)
    sums, square = np.zeros(17 * WIDE, np.float32), np.zeros((side, 3 * WIDE), np.float32)
    for n in range(count):
        spot, shape = found[n], shapes[n]
        shape[0], shape[1], shape[2] = usual[0], usual[1], usual[2]
        for row in range(side):
            line, start = square[row], row * side
            lit, weighty, lost = signal[n, start:], weights[n, start:], burnt[n, start:]
            for k in range(side):
                line[k] = lit[k]
                line[WIDE + k] = weighty[k]
                line[2 * WIDE + k] = lost[k]
        misfit, number, scale = 0.0, 0.0, 1.0
        for _ in range(steps):
            if free_shape:
                for i in range(3):
                    falls[i] = np.exp(-shape[i])
            misfit, number = _equations(square, side, spot, shape, falls, free_shape, sums, normal, right)
            for i in range(unknowns):
                normal[i, i] += 1e-3 * normal[i, i] + 1e-9
            _solve(normal, right, unknowns, False)
            pxx, pxy, pyy = shape[0], shape[1], shape[2]
            level = max(spot[2], 1.0)
            scale = 1 / (level * (pxx * pyy - pxy * pxy))
            du = scale * (pyy * right[2] - pxy * right[3])
            dv = scale * (pxx * right[3] - pxy * right[2])
            spot[0] = min(max(spot[0] + min(max(du, -0.8), 0.8), -bound), bound)
            spot[1] = min(max(spot[1] + min(max(dv, -0.8), 0.8), -bound), bound)
            spot[2] = max(level + right[1], 0.5)
            spot[3] += right[0]
            if free_shape:
                shape[0] = min(max(pxx + min(max(-2 * right[4] / level, -0.3 * pxx), 0.5 * pxx), 0.03), 1.6)
                shape[2] = min(max(pyy + min(max(-2 * right[6] / level, -0.3 * pyy), 0.5 * pyy), 0.03), 1.6)
                most = 0.9 * np.sqrt(shape[0] * shape[2])
                shape[1] = min(max(pxy - right[5] / level, -most), most)
            elif abs(du) + abs(dv) < CONVERGED_PX and abs(right[1]) < 2 * CONVERGED_PX * level:
                break
        if free_shape:
            continue
        quality[n, 3] = misfit / max(number - unknowns, 1.0)
        pxx, pxy, pyy = shape[0], shape[1], shape[2]
        for which in range(3):
            right[:] = 0.0
            if which == 0:
                right[2], right[3] = scale * pyy, -scale * pxy
            elif which == 1:
                right[2], right[3] = -scale * pxy, scale * pxx
            else:
                right[1] = 1.0
            a, b, c = right[2], right[3], right[1]
            _solve(normal, right, 4, True)
            quality[n, which] = a * right[2] + b * right[3] + c * right[1]
