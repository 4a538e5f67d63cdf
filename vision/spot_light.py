"""Inner loops that tell what the laser added around each peak, and how well that is known."""

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
def weighed(
    signal: Floats, background: Floats, weights: Floats, about: Floats, noise2: float, registration_px: float
) -> None:
    """Replace the raw laser-off image in signal (n, p) by Wiener's estimate of it, and the squared slopes in weights
    (n, p) by the inverse variance of the signal.

    As much of the laser-off image's detail counts as exceeds its noise (Lee 1980), so that where the blade is plain
    the noise of only one image does. about (n, 2): as `lights` writes it; noise2: variance of one image's noise."""
    for n in range(len(signal)):
        detail = max(about[n, 0] - noise2, 0.0)
        gain = detail / (detail + noise2)
        plain = np.float32(noise2 * (1 + gain * gain) + (1 - gain) ** 2 * detail)
        smooth, apart = np.float32(1 - gain), np.float32(registration_px**2)
        half = np.float32(noise2 / 2)
        light, rest, weight = signal[n], background[n], weights[n]
        for k in range(len(light)):
            light[k] += smooth * rest[k]
            weight[k] = np.float32(1) / (plain + apart * max(weight[k] - half, np.float32(0)))


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
    total, number, last = 0.0, 0, side * side - side
    for k in range(side - 2):
        for start, step in ((0, 1), (last, 1), (0, side), (side - 1, side)):
            at = start + k * step
            bend = values[at] - np.float32(2) * values[at + step] + values[at + 2 * step]
            total += bend * bend
            number += 1
    variance: float = total / (6 * number)
    return variance
