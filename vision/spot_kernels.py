"""Inner loops that measure laser spots: what the laser added around each peak, and Gaussian spots fitted to that.

A spot is level · exp(−½ (pxx x² + 2 pxy x y + pyy y²)) + base about its centre; (pxx, pxy, pyy) is its shape.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled

Floats = NDArray[Any]

BURNT = 250  # grey level from which a pixel only says that there was at least as much light
REGISTRATION_PX = 0.12  # how far laser-off and laser-on images may lie apart after their motion is made up for
LEAST_VARIANCE = 0.1  # grey levels², of rounding


@compiled
def lights(
    on: Image, off: Image, subtracted: bool, peaks: NDArray[np.int64], motion: Floats, fit: Floats, basis: Floats,
    signal: Floats, background: Floats, slope2: Floats, burnt: NDArray[np.bool_], variances: Floats,
) -> None:  # fmt: skip
    """What the laser-on image has more than the laser-off image in a square around each of n peaks (u, v).

    fit (6, p) and basis (p, 6): least squares of a quadratic surface on the p pixels of a square. Written: signal
    (n, p) = on minus the raw laser-off image, background (n, p) = the laser-off image minus its quadratic surface,
    slope2 (n, p) = its squared gradient, variances (n, 2): of the laser-off image about its surface, and of the
    difference along the border. Without a laser-off image (not `subtracted`), signal is the laser-on image."""
    height, width = on.shape
    count, size = signal.shape
    side = int(np.sqrt(size) + 0.5)
    reach = side // 2
    shift_u, shift_v = int(np.floor(-motion[0])), int(np.floor(-motion[1]))
    part_u, part_v = np.float32(-motion[0] - shift_u), np.float32(-motion[1] - shift_v)
    still = np.empty(size, np.float32)
    for n in range(count):
        for k in range(size):
            v = peaks[n, 1] + k // side - reach
            u = peaks[n, 0] + k % side - reach
            top, left = min(max(v + shift_v, 0), height - 1), min(max(u + shift_u, 0), width - 1)
            value = np.float32(off[top, left])
            light = on[min(max(v, 0), height - 1), min(max(u, 0), width - 1)]
            burnt[n, k] = light >= BURNT
            if part_u > 0 or part_v > 0:
                low, right = min(max(v + shift_v + 1, 0), height - 1), min(max(u + shift_u + 1, 0), width - 1)
                upper = value + part_u * (np.float32(off[top, right]) - value)
                lower = np.float32(off[low, left])
                lower += part_u * (np.float32(off[low, right]) - lower)
                value = upper + part_v * (lower - upper)
            still[k] = value
            signal[n, k] = np.float32(light) - (value if subtracted else np.float32(0))
        about = np.float32(0)
        coefficients = np.zeros(6, np.float32)
        for j in range(6):
            total = np.float32(0)
            for k in range(size):
                total += fit[j, k] * still[k]
            coefficients[j] = total
        for k in range(size):
            surface = np.float32(0)
            for j in range(6):
                surface += basis[k, j] * coefficients[j]
            background[n, k] = still[k] - surface
            about += background[n, k] * background[n, k]
            row, column = k // side, k % side
            across = still[min(k + 1, size - 1) if column < side - 1 else k] - still[k - 1 if column > 0 else k]
            down = still[k + side if row < side - 1 else k] - still[k - side if row > 0 else k]
            slope2[n, k] = np.float32(0.25) * (across * across + down * down)
        variances[n, 0] = about / (size - 6)
        # neighbours' differences along the border of the square hold noise and hardly any of the spot
        rough, number = np.float32(0), 0
        for k in range(side - 2):
            for start, step in ((0, 1), (size - side, 1), (0, side), (side - 1, side)):
                bend = (
                    signal[n, start + k * step]
                    - np.float32(2) * signal[n, start + (k + 1) * step]
                    + signal[n, start + (k + 2) * step]
                )
                rough += bend * bend
                number += 1
        variances[n, 1] = rough / np.float32(6 * number)


@compiled
def _solved(matrix: Floats, right: Floats, count: int) -> None:
    """Solve in place by Cholesky; right (count,) becomes the solution, the lower triangle of matrix its factor."""
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
def spots_fitted(
    signal: Floats, variance: Floats, burnt: NDArray[np.bool_], shapes: Floats, free_shape: bool, planes: bool,
    steps: int, found: Floats, quality: Floats,
) -> None:  # fmt: skip
    """Fit a spot to each square by Gauss and Newton, weighting by `variance` (n, p).

    burnt (n, p): pixels that say no more than "at least". shapes (n, 3), fitted too if free_shape. planes: the base is
    a plane and no constant. found (n, 4): u, v from the middle, level, base; holds the start. Written besides: quality
    (n, 4) = variances of u, of v, of the level, mean squared residual over its variance."""
    count, size = signal.shape
    side = int(np.sqrt(size) + 0.5)
    reach = side // 2
    unknowns = 4 + (3 if free_shape else 0) + (2 if planes else 0)
    normal = np.zeros((9, 9))
    right, slopes = np.zeros(9), np.zeros(9)
    for n in range(count):
        u, v, level, base = found[n, 0], found[n, 1], found[n, 2], found[n, 3]
        pxx, pxy, pyy = shapes[n, 0], shapes[n, 1], shapes[n, 2]
        tilt_u, tilt_v = 0.0, 0.0
        misfit, weights = 0.0, 0.0
        for step in range(steps + 1):
            last = step == steps
            normal[:] = 0.0
            right[:] = 0.0
            misfit, weights = 0.0, 0.0
            for row in range(side):
                y = row - reach - v
                x = -reach - u
                bell = np.exp(-0.5 * (pxx * x * x + 2 * pxy * x * y + pyy * y * y))
                ratio = np.exp(-0.5 * (pxx * (2 * x + 1) + 2 * pxy * y))
                change = np.exp(-pxx)
                for column in range(side):
                    k = row * side + column
                    model = level * bell + base + tilt_u * (column - reach) + tilt_v * (row - reach)
                    residual = signal[n, k] - model
                    if not (burnt[n, k] and residual < 0):
                        weight = 1.0 / variance[n, k]
                        lifted = level * bell
                        slopes[0] = lifted * (pxx * x + pxy * y)
                        slopes[1] = lifted * (pxy * x + pyy * y)
                        slopes[2] = bell
                        slopes[3] = 1.0
                        at = 4
                        if planes:
                            slopes[4] = column - reach
                            slopes[5] = row - reach
                            at = 6
                        if free_shape:
                            slopes[at] = -0.5 * lifted * x * x
                            slopes[at + 1] = -lifted * x * y
                            slopes[at + 2] = -0.5 * lifted * y * y
                        for i in range(unknowns):
                            scaled = weight * slopes[i]
                            right[i] += scaled * residual
                            for j in range(i + 1):
                                normal[i, j] += scaled * slopes[j]
                        misfit += weight * residual * residual
                        weights += 1.0
                    x += 1.0
                    bell *= ratio
                    ratio *= change
            for i in range(unknowns):
                normal[i, i] *= 1.0 + (1e-3 if not last else 1e-9)
                normal[i, i] += 1e-9
            if last:
                break
            _solved(normal, right, unknowns)
            u += min(max(right[0], -0.8), 0.8)
            v += min(max(right[1], -0.8), 0.8)
            level = max(level + right[2], 0.5)
            base += right[3]
            if planes:
                tilt_u += right[4]
                tilt_v += right[5]
            if free_shape:
                at = 6 if planes else 4
                pxx = min(max(pxx + min(max(right[at], -0.3 * pxx), 0.5 * pxx), 0.03), 1.6)
                pyy = min(max(pyy + min(max(right[at + 2], -0.3 * pyy), 0.5 * pyy), 0.03), 1.6)
                bound = 0.9 * np.sqrt(pxx * pyy)
                pxy = min(max(pxy + right[at + 1], -bound), bound)
            bound = reach - 0.5
            u, v = min(max(u, -bound), bound), min(max(v, -bound), bound)
        found[n, 0], found[n, 1], found[n, 2], found[n, 3] = u, v, level, base
        shapes[n, 0], shapes[n, 1], shapes[n, 2] = pxx, pxy, pyy
        quality[n, 3] = misfit / max(weights - unknowns, 1.0)
        for which in range(3):
            right[:] = 0.0
            right[which] = 1.0
            if which > 0:
                _substituted(normal, right, unknowns)
            else:
                _solved(normal, right, unknowns)
            quality[n, which] = right[which]


@compiled
def _substituted(factor: Floats, right: Floats, count: int) -> None:
    """Solve in place with the factor that `_solved` left."""
    for i in range(count):
        total = right[i]
        for k in range(i):
            total -= factor[i, k] * right[k]
        right[i] = total / factor[i, i]
    for i in range(count - 1, -1, -1):
        total = right[i]
        for k in range(i + 1, count):
            total -= factor[k, i] * right[k]
        right[i] = total / factor[i, i]
