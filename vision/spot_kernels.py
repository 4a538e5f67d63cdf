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


@compiled
def lights(
    on: Image, off: Image, subtracted: bool, peaks: NDArray[np.int64], motion: Floats, fit: Floats, basis: Floats,
    signal: Floats, background: Floats, slope2: Floats, burnt: NDArray[np.bool_], variances: Floats,
) -> None:  # fmt: skip
    """What the laser-on image has more than the laser-off image in a square around each of n peaks (u, v).

    fit (6, p) and basis (p, 6): least squares of a quadratic surface on the p pixels of a square. Written: signal
    (n, p) = on minus the raw laser-off image, background (n, p) = the laser-off image minus its quadratic surface,
    slope2 (n, p) = its squared gradient, burnt (n, p), variances (n, 2): of the laser-off image about its surface,
    and of the difference along the border. Without a laser-off image (not `subtracted`) a plane through the border of
    the laser-on image stands for it."""
    height, width = on.shape
    count, size = signal.shape
    side = int(np.sqrt(size) + 0.5)
    reach = side // 2
    shift_u, shift_v = int(np.floor(-motion[0])), int(np.floor(-motion[1]))
    part_u, part_v = np.float32(-motion[0] - shift_u), np.float32(-motion[1] - shift_v)
    still = np.empty(size, np.float32)
    coefficients = np.empty(6, np.float32)
    for n in range(count):
        for k in range(size):
            v = peaks[n, 1] + k // side - reach
            u = peaks[n, 0] + k % side - reach
            light = on[min(max(v, 0), height - 1), min(max(u, 0), width - 1)]
            burnt[n, k] = light >= BURNT
            signal[n, k] = light
            if subtracted:
                top, left = min(max(v + shift_v, 0), height - 1), min(max(u + shift_u, 0), width - 1)
                value = np.float32(off[top, left])
                if part_u > 0 or part_v > 0:
                    low, right = min(max(v + shift_v + 1, 0), height - 1), min(max(u + shift_u + 1, 0), width - 1)
                    upper = value + part_u * (np.float32(off[top, right]) - value)
                    lower = np.float32(off[low, left])
                    lower += part_u * (np.float32(off[low, right]) - lower)
                    value = upper + part_v * (lower - upper)
                still[k] = value
        if not subtracted:
            _plane_through_border(signal[n], still, side)
        for k in range(size):
            signal[n, k] -= still[k]
        about = np.float32(0)
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
            across = still[k + 1 if column < side - 1 else k] - still[k - 1 if column > 0 else k]
            down = still[k + side if row < side - 1 else k] - still[k - side if row > 0 else k]
            slope2[n, k] = np.float32(0.25) * (across * across + down * down)
        variances[n, 0] = about / (size - 6)
        variances[n, 1] = _border_roughness(signal[n], side)


@compiled
def _plane_through_border(values: Floats, plane: Floats, side: int) -> None:
    """The plane through the outermost pixels of a square, least squares."""
    reach = side // 2
    mean, slope_u, slope_v, spread, count = 0.0, 0.0, 0.0, 0.0, 0
    for k in range(side * side):
        y, x = k // side - reach, k % side - reach
        if abs(x) == reach or abs(y) == reach:
            mean += values[k]
            slope_u += x * values[k]
            slope_v += y * values[k]
            spread += x * x
            count += 1
    for k in range(side * side):
        plane[k] = mean / count + (slope_u * (k % side - reach) + slope_v * (k // side - reach)) / spread


@compiled
def _border_roughness(values: Floats, side: int) -> float:
    """Variance of noise from second differences along a square's border, where there is hardly any of the spot."""
    total, number, last = np.float32(0), 0, side * side - side
    for k in range(side - 2):
        for start, step in ((0, 1), (last, 1), (0, side), (side - 1, side)):
            at = start + k * step
            bend = values[at] - np.float32(2) * values[at + step] + values[at + 2 * step]
            total += bend * bend
            number += 1
    return total / (6 * number)


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
    signal: Floats, variance: Floats, burnt: NDArray[np.bool_], spot: Floats, shape: Floats, normal: Floats,
    right: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Normal equations of the residual about a spot (u, v, level, base) in terms of base and the bell times (1, x, y,
    x², xy, y²), in this order, x and y from the spot's centre; returned: weighted squares of residuals, their
    number."""
    side = int(np.sqrt(signal.size) + 0.5)
    reach = side // 2
    u, v, level, base = spot[0], spot[1], spot[2], spot[3]
    pxx, pxy, pyy = shape[0], shape[1], shape[2]
    normal[:] = 0.0
    right[:] = 0.0
    misfit, number = 0.0, 0.0
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
            if not (burnt[k] and residual < 0):
                weight = 1.0 / variance[k]
                single = weight * bell
                square = single * bell
                x2 = x * x
                w0 += weight
                e0 += single
                e1 += single * x
                e2 += single * x2
                s0 += square
                s1 += square * x
                s2 += square * x2
                s3 += square * x2 * x
                s4 += square * x2 * x2
                r += weight * residual
                r0 += single * residual
                r1 += single * residual * x
                r2 += single * residual * x2
                misfit += weight * residual * residual
                number += 1.0
            x += 1.0
            bell *= ratio
            ratio *= change
        y2 = y * y
        normal[0, 0] += w0
        normal[1, 0] += e0
        normal[2, 0] += e1
        normal[3, 0] += y * e0
        normal[4, 0] += e2
        normal[5, 0] += y * e1
        normal[6, 0] += y2 * e0
        normal[1, 1] += s0
        normal[2, 1] += s1
        normal[3, 1] += y * s0
        normal[4, 1] += s2
        normal[5, 1] += y * s1
        normal[6, 1] += y2 * s0
        normal[4, 2] += s3
        normal[5, 2] += y * s2
        normal[6, 2] += y2 * s1
        normal[6, 3] += y2 * y * s0
        normal[4, 4] += s4
        normal[5, 4] += y * s3
        normal[6, 4] += y2 * s2
        normal[6, 5] += y2 * y * s1
        normal[6, 6] += y2 * y2 * s0
        right[0] += r
        right[1] += r0
        right[2] += r1
        right[3] += y * r0
        right[4] += r2
        right[5] += y * r1
        right[6] += y2 * r0
    normal[2, 2], normal[3, 2], normal[3, 3] = normal[4, 1], normal[5, 1], normal[6, 1]
    normal[4, 3], normal[5, 3], normal[5, 5] = normal[5, 2], normal[6, 2], normal[6, 4]
    return misfit, number


@compiled
def fit_spots(
    signal: Floats, variance: Floats, burnt: NDArray[np.bool_], shapes: Floats, free_shape: bool, steps: int,
    found: Floats, quality: Floats,
) -> None:  # fmt: skip
    """Fit a spot to each square by Gauss and Newton, weighting by `variance` (n, p).

    burnt (n, p): pixels that say no more than "at least". shapes (n, 3), fitted too if free_shape. found (n, 4): u, v
    from the middle, level, base; holds the start. Written besides: quality (n, 4) = variances of u, of v, of the
    level, mean squared residual over its variance."""
    count, size = signal.shape
    bound = int(np.sqrt(size) + 0.5) // 2 - 0.5
    unknowns = 7 if free_shape else 4
    normal, right = np.zeros((7, 7)), np.zeros(7)
    for n in range(count):
        spot, shape = found[n], shapes[n]
        for _ in range(steps):
            _equations(signal[n], variance[n], burnt[n], spot, shape, normal, right)
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
            if abs(du) + abs(dv) < 0.01 and abs(right[1]) < 0.02 * level and not free_shape:
                break
        misfit, number = _equations(signal[n], variance[n], burnt[n], spot, shape, normal, right)
        quality[n, 3] = misfit / max(number - unknowns, 1.0)
        pxx, pxy, pyy, level = shape[0], shape[1], shape[2], spot[2]
        scale = 1 / (level * (pxx * pyy - pxy * pxy))
        for which in range(3):
            right[:] = 0.0
            if which == 0:
                right[2], right[3] = scale * pyy, -scale * pxy
            elif which == 1:
                right[2], right[3] = -scale * pxy, scale * pxx
            else:
                right[1] = 1.0
            a, b, c = right[2], right[3], right[1]
            _solve(normal, right, 4, which > 0)
            quality[n, which] = a * right[2] + b * right[3] + c * right[1]
