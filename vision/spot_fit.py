"""Inner loops that fit Gaussian spots to what the laser added around peaks.

A spot is level · exp(−½ (pxx x² + 2 pxy x y + pyy y²)) + base about its centre; (pxx, pxy, pyy) is its shape.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]

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
    signal: Floats, weights: Floats, burnt: NDArray[np.bool_], spot: Floats, shape: Floats, full: bool,
    normal: Floats, right: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Normal equations of the residual about a spot (u, v, level, base) in terms of base and the bell times (1, x, y,
    x², xy, y²), in this order, x and y from the spot's centre, the last three only if `full`; returned: weighted
    squares of residuals, their number."""
    side = int(np.sqrt(signal.size) + 0.5)
    reach = side // 2
    u, v, level, base = spot[0], spot[1], spot[2], spot[3]
    pxx, pxy, pyy = shape[0], shape[1], shape[2]
    normal[:] = 0.0
    right[:] = 0.0
    misfit, number = 0.0, 1.0 * signal.size
    change = np.exp(-pxx)
    for row in range(side):
        y = row - reach - v
        x = -reach - u
        bell = np.exp(-0.5 * (pxx * x * x + 2 * pxy * x * y + pyy * y * y))
        ratio = np.exp(-0.5 * (pxx * (2 * x + 1) + 2 * pxy * y))
        w0, e0, e1, e2, s0, s1, s2, s3, s4 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        r, r0, r1, r2 = 0.0, 0.0, 0.0, 0.0
        for k in range(row * side, row * side + side):
            residual = signal[k] - level * bell - base
            weight = 1.0 * weights[k]
            if burnt[k] and residual < 0:
                weight = 0.0
                number -= 1.0
            single = weight * bell
            square = single * bell
            lever = single * x
            lever2 = square * x
            apart = single * residual
            w0 += weight
            e0 += single
            e1 += lever
            s0 += square
            s1 += lever2
            s2 += lever2 * x
            r += weight * residual
            r0 += apart
            r1 += apart * x
            misfit += weight * residual * residual
            if full:
                x2 = x * x
                e2 += lever * x
                s3 += lever2 * x2
                s4 += lever2 * x2 * x
                r2 += apart * x2
            x += 1.0
            bell *= ratio
            ratio *= change
        y2 = y * y
        normal[0, 0] += w0
        normal[1, 0] += e0
        normal[2, 0] += e1
        normal[3, 0] += y * e0
        normal[1, 1] += s0
        normal[2, 1] += s1
        normal[3, 1] += y * s0
        normal[4, 1] += s2
        normal[5, 1] += y * s1
        normal[6, 1] += y2 * s0
        right[0] += r
        right[1] += r0
        right[2] += r1
        right[3] += y * r0
        if full:
            normal[4, 0] += e2
            normal[5, 0] += y * e1
            normal[6, 0] += y2 * e0
            normal[4, 2] += s3
            normal[5, 2] += y * s2
            normal[6, 2] += y2 * s1
            normal[6, 3] += y2 * y * s0
            normal[4, 4] += s4
            normal[5, 4] += y * s3
            normal[6, 4] += y2 * s2
            normal[6, 5] += y2 * y * s1
            normal[6, 6] += y2 * y2 * s0
            right[4] += r2
            right[5] += y * r1
            right[6] += y2 * r0
    normal[2, 2], normal[3, 2], normal[3, 3] = normal[4, 1], normal[5, 1], normal[6, 1]
    normal[4, 3], normal[5, 3], normal[5, 5] = normal[5, 2], normal[6, 2], normal[6, 4]
    return misfit, number


@compiled
def fit_spots(
    signal: Floats, weights: Floats, burnt: NDArray[np.bool_], shapes: Floats, free_shape: bool, steps: int,
    found: Floats, quality: Floats,
) -> None:  # fmt: skip
    """Fit a spot to each square by Gauss and Newton, weighting by `weights` (n, p).

    burnt (n, p): pixels that say no more than "at least". shapes (n, 3), fitted too if free_shape. found (n, 4): u, v
    from the middle, level, base; holds the start. Written besides: quality (n, 4) = variances of u, of v, of the
    level, mean of weighted squared residuals."""
    count, size = signal.shape
    bound = int(np.sqrt(size) + 0.5) // 2 - 0.5
    unknowns = 7 if free_shape else 4
    normal, right = np.zeros((7, 7)), np.zeros(7)
    for n in range(count):
        spot, shape = found[n], shapes[n]
        misfit, number, scale = 0.0, 0.0, 1.0
        for _ in range(steps):
            misfit, number = _equations(signal[n], weights[n], burnt[n], spot, shape, free_shape, normal, right)
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


@compiled
def first_of_each(uv: Floats, apart_px: float, keep: NDArray[np.bool_]) -> None:
    """Clear keep (n,) where an earlier point of uv (n, 2) that is kept lies nearer than a distance."""
    for n in range(len(uv)):
        for m in range(n):
            if keep[m] and (uv[n, 0] - uv[m, 0]) ** 2 + (uv[n, 1] - uv[m, 1]) ** 2 < apart_px**2:
                keep[n] = False
                break
