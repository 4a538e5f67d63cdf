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
    on: Image, off: Image, channel: int, subtracted: bool, peaks: NDArray[np.int64], motion: Floats, fit: Floats,
    basis: Floats, limits: tuple[float, float, float], signal: Floats, weights: Floats, burnt: NDArray[np.bool_],
    start: Floats,
) -> None:  # fmt: skip
    """What the laser-on image (h, w, c) has more than the laser-off image in a square around each of n peaks (u, v), in
    one channel.

    fit (6, p) and basis (6, p): least squares of a quadratic surface on the p pixels of a square. limits: least
    variance of the noise, how far apart the images may lie in px, and the level of a spot whose middle is burnt out.
    Written: signal (n, p) = on minus Wiener's estimate of the laser-off image, weights (n, p), its inverse variance,
    burnt (n, p), and start (n, 4), of which the third is a first guess of the level. Without a laser-off image (not
    `subtracted`) a plane through the border of the laser-on image stands for it."""
    least_variance, registration_px, burnt_level = limits
    background, variances = np.empty(signal.shape, np.float32), np.empty((len(signal), 2), np.float32)
    _differences(on, off, channel, subtracted, peaks, motion, fit, basis, signal, background, weights, burnt, variances)
    count, size = signal.shape
    rough = variances[:, 1].copy()
    noise2 = max(_median(rough) / (2 if subtracted else 1), least_variance)
    if subtracted:
        _weighed(signal, background, weights, variances, noise2, registration_px)
    else:
        weights[:] = np.float32(1 / noise2)
    middle = size // 2
    for n in range(count):
        level = (signal[n, middle - 1] + signal[n, middle] + signal[n, middle + 1]) / np.float32(3)
        start[n, 2] = max(level, burnt_level if burnt[n, middle] else 1.0)


@compiled
def _median(values: Floats) -> Any:
    """Median of a few values; they are put in order."""
    count = len(values)
    for k in range(1, count):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
    return (values[(count - 1) // 2] + values[count // 2]) / 2


@compiled
def _differences(
    on: Image, off: Image, channel: int, subtracted: bool, peaks: NDArray[np.int64], motion: Floats, fit: Floats,
    basis: Floats, signal: Floats, background: Floats, slope2: Floats, burnt: NDArray[np.bool_], variances: Floats,
) -> None:  # fmt: skip
    """As `lights`, but written are: signal (n, p) = on minus the raw laser-off image, background (n, p) = the laser-off
    image minus its quadratic surface, slope2 (n, p) = its squared gradient, burnt (n, p), variances (n, 2): of the
    laser-off image about its surface, and of the difference along the border."""
    count, size = signal.shape
    side = int(np.sqrt(size) + 0.5)
    reach, wide = side // 2, side + 1
    shift_u, shift_v = int(np.floor(-motion[0])), int(np.floor(-motion[1]))
    part_u, part_v = np.float32(-motion[0] - shift_u), np.float32(-motion[1] - shift_v)
    flat_on, flat_off = on.reshape(-1), off.reshape(-1)
    lit, flat, rest = np.empty(size, np.float32), np.empty(size, np.float32), np.empty(size, np.float32)
    raw, moved = np.zeros(wide * wide + 1, np.float32), np.zeros(wide * side, np.float32)
    right, under, across_under = raw[1:], raw[wide:], raw[wide + 1 :]
    behind, ahead, over, below = flat[side - 1 :], flat[side + 1 :], flat, flat[2 * side :]
    quarter, full = np.float32(0.25), np.float32(BURNT)
    f0, f1, f2, f3, f4, f5 = fit[0], fit[1], fit[2], fit[3], fit[4], fit[5]
    b0, b1, b2, b3, b4, b5 = basis[0], basis[1], basis[2], basis[3], basis[4], basis[5]
    for n in range(count):
        left, top = peaks[n, 0] - reach, peaks[n, 1] - reach
        _square(flat_on, on.shape, channel, left, top, side, lit)
        light, lost, ground, steep = signal[n], burnt[n], background[n], slope2[n]
        for k in range(size):
            light[k] = lit[k]
            lost[k] = lit[k] >= full
        if subtracted:
            _square(flat_off, off.shape, channel, left + shift_u, top + shift_v, wide, raw)
            for k in range(wide * side):
                high = raw[k] + part_u * (right[k] - raw[k])
                low = under[k] + part_u * (across_under[k] - under[k])
                moved[k] = high + part_v * (low - high)
            for i in range(side):
                for k in range(side):
                    flat[i * side + k] = moved[i * wide + k]
        else:
            _plane_through_border(light, flat, side)
        c0, c1, c2 = np.float32(0), np.float32(0), np.float32(0)
        c3, c4, c5 = np.float32(0), np.float32(0), np.float32(0)
        for k in range(size):
            value = flat[k]
            light[k] -= value
            c0 += f0[k] * value
            c1 += f1[k] * value
            c2 += f2[k] * value
            c3 += f3[k] * value
            c4 += f4[k] * value
            c5 += f5[k] * value
        for k in range(size):
            rest[k] = flat[k] - (b0[k] * c0 + b1[k] * c1 + b2[k] * c2 + b3[k] * c3 + b4[k] * c4 + b5[k] * c5)
        about = np.float32(0)
        for k in range(size):
            ground[k] = rest[k]
            about += rest[k] * rest[k]
        inner = steep[side:]
        for k in range(size - 2 * side):
            across, down = ahead[k] - behind[k], below[k] - over[k]
            inner[k] = quarter * (across * across + down * down)
        _border_slopes(flat, side, steep)
        variances[n, 0] = about / (size - 6)
        variances[n, 1] = _border_roughness(light, side)


@compiled
def _border_slopes(flat: Floats, side: int, steep: Floats) -> None:
    """The squared gradient along the border of a square, which has no neighbours outside."""
    last, quarter = side * side - side, np.float32(0.25)
    for i in range(side):
        before, after = max(i - 1, 0), min(i + 1, side - 1)
        top, low = flat[after] - flat[before], flat[last + after] - flat[last + before]
        in_top, in_low = flat[side + i] - flat[i], flat[last + i] - flat[last - side + i]
        steep[i] = quarter * (top * top + in_top * in_top)
        steep[last + i] = quarter * (low * low + in_low * in_low)
    for i in range(1, side - 1):
        k, m = i * side, i * side + side - 1
        left, right = flat[k + side] - flat[k - side], flat[m + side] - flat[m - side]
        in_left, in_right = flat[k + 1] - flat[k], flat[m] - flat[m - 1]
        steep[k] = quarter * (in_left * in_left + left * left)
        steep[m] = quarter * (in_right * in_right + right * right)


@compiled
def _square(
    image: Image, size: tuple[int, int, int], channel: int, left: int, top: int, side: int, values: Floats
) -> None:
    """The pixels of a square from (left, top) on, row by row, of one channel of an image of some size (h, w, c), flat;
    the border continues outward."""
    height, width, channels = size
    if left >= 0 and top >= 0 and left + side <= width and top + side <= height:
        for i in range(side):
            start, to = ((top + i) * width + left) * channels + channel, i * side
            if channels == 1:  # a loop of its own, whose stride is known
                for k in range(side):
                    values[to + k] = image[start + k]
            else:
                for k in range(side):
                    values[to + k] = image[start + channels * k]
        return
    for i in range(side):
        start, to = min(max(top + i, 0), height - 1) * width, i * side
        for k in range(side):
            values[to + k] = image[(start + min(max(left + k, 0), width - 1)) * channels + channel]


@compiled
def _weighed(
    signal: Floats, background: Floats, weights: Floats, about: Floats, noise2: float, registration_px: float
) -> None:
    """Replace the raw laser-off image in signal (n, p) by Wiener's estimate of it, and the squared slopes in weights
    (n, p) by the inverse variance of the signal.

    As much of the laser-off image's detail counts as exceeds its noise (Lee 1980), so that where the blade is plain
    the noise of only one image does. about (n, 2): as `_differences` writes it; noise2: variance of one image."""
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
