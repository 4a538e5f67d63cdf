"""Where a laser may have made a spot: peaks of the light gained between a laser-off and a laser-on image, or, in a
single laser-on image, of what stands above all its surroundings. Half-size images; compiled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled
from vision.workspace import lent

Array = NDArray[Any]  # of floats
Peaks = NDArray[np.int64]

RING = 4  # px of the half-size image, where a dot of a single laser-on image must have fallen off on every side
SIGNIFICANT = 4.0  # standard deviations, from which a gain of light is no noise
LEAST_NOISE = 0.1  # grey levels, of a 3 × 3 mean of the half-size image
CLEARLY_NO_NOISE = 2.5  # standard deviations: what gained more does not tell how much noise there is
APART_STILL, APART_MOVED = 0.04, 0.1  # px by which two half-size images may lie apart, as a standard deviation
SOFTENED = 0.3  # of a pixel's noise, what is left in a Gaussian mean over 5 × 5
MOST = 180  # peaks kept, the strongest; the grid has 121 dots
NEAREST = np.array(sorted(set(range(25)) - {12}, key=lambda k: (k // 5 - 2) ** 2 + (k % 5 - 2) ** 2))  # of 5 × 5 places
AROUND = 3  # px about a box, of which 7 × 7 means and slopes are taken


@dataclass(frozen=True)
class Reach:
    """Where dots can be in a half-size image: mask (h, w), not zero there; box: left, top, right, bottom of that part,
    the last two not in it."""

    mask: Image
    box: tuple[int, int, int, int]

    @classmethod
    def of(cls, mask: Image) -> Reach:
        """From a mask of the whole image."""
        half = np.ascontiguousarray(mask[: mask.shape[0] // 2 * 2 : 2, : mask.shape[1] // 2 * 2 : 2])
        left, top, width, height = cv2.boundingRect(half)
        return cls(half, (left, top, left + width, top + height))

    @classmethod
    def everywhere(cls, shape: tuple[int, ...]) -> Reach:
        """In a whole half-size image."""
        return cls(np.full(shape, 255, np.uint8), (0, 0, shape[1], shape[0]))


def gained(off: Image, on: Image, motion: Array, reach: Reach) -> Peaks:
    """Peaks (n, 2) (u, v) of the whole image, strongest first, where the half-size `on` gained light over `off` moved
    by motion (2,) px of the whole image."""
    left, top, right, bottom = reach.box
    left, top = max(left - AROUND, 0), max(top - AROUND, 0)
    right, bottom = min(right + AROUND, on.shape[1]), min(bottom + AROUND, on.shape[0])
    height, width = bottom - top, right - left
    gain, step = lent("gains", (2 * on.size,), np.float32)[: 2 * height * width].reshape(2, height, width)
    _gains(off, on, -float(motion[0]) / 2, -float(motion[1]) / 2, left, top, gain, step)
    apart = APART_MOVED if motion.any() else APART_STILL
    return _strongest(gain, step, max(_noise(gain, CLEARLY_NO_NOISE), LEAST_NOISE), apart, reach.mask, left, top)


def standing_out(on: Image, reach: Reach) -> Peaks:
    """Peaks as of `gained` in a single laser-on image, by how far each pixel stands above the brightest on a ring
    around it: neither edges nor cables do, for the ring meets them, too."""
    v, u = np.mgrid[-RING : RING + 1, -RING : RING + 1]
    ring = (np.abs(np.hypot(u, v) - RING) < 0.5).astype(np.uint8)
    light = on.astype(np.float32)
    soft = cv2.GaussianBlur(light, (5, 5), 0)
    height = np.asarray(soft - cv2.dilate(soft, ring), np.float32)
    height[:RING], height[-RING:], height[:, :RING], height[:, -RING:] = 0, 0, 0, 0
    rough = light[::3, 2:] - 2 * light[::3, 1:-1] + light[::3, :-2]
    noise = 1.4826 * float(np.median(np.abs(rough))) / np.sqrt(6)
    return _strongest(height, np.zeros_like(height), max(SOFTENED * noise, LEAST_NOISE), 0.0, reach.mask, 0, 0)


def _strongest(gain: Array, step: Array, noise: float, apart: float, mask: Image, left: int, top: int) -> Peaks:
    uv, level = np.empty((16 * MOST, 2), np.int64), np.empty(16 * MOST, np.float32)
    count = _maxima(gain, step, noise, apart, SIGNIFICANT, mask, left, top, uv, level)
    order = np.argsort(-level[:count], kind="stable")[:MOST]
    return np.ascontiguousarray(uv[:count][order])


@compiled
def _gains(off: Image, on: Image, du: float, dv: float, box_left: int, box_top: int, gain: Array, step: Array) -> None:
    """Write gain (h, w) of the box that begins at (box_left, box_top): on minus off, sampled (du, dv) away, mean of
    3 × 3 over that of 7 × 7; step (h, w): slope of the sampled off, grey levels per px. Zero along the border of image
    and box."""
    rows, columns = gain.shape
    height, width = on.shape
    shift_u, shift_v = int(np.floor(du)), int(np.floor(dv))
    part_u, part_v = np.float32(du - shift_u), np.float32(dv - shift_v)
    one = np.float32(1)
    c00, c01 = (one - part_u) * (one - part_v), part_u * (one - part_v)
    c10, c11 = (one - part_u) * part_v, part_u * part_v
    left, right = max(box_left, -shift_u), min(box_left + columns, width - shift_u - 1)
    top, bottom = max(box_top, -shift_v), min(box_top + rows, height - shift_v - 1)
    inner = right - left
    if inner < 8 or bottom - top < 8:
        gain[:], step[:] = 0, 0
        return
    first, start, count = top + 3 - box_top, left - box_left + 3, inner - 6
    for row in range(rows):
        whole = row < first or row >= bottom - 3 - box_top
        gain[row, : columns if whole else start], step[row, : columns if whole else start] = 0, 0
        gain[row, start + count :], step[row, start + count :] = 0, 0
    # the last seven rows that were sampled, and their differences
    still = np.empty((8, inner), np.float32)
    difference = np.empty((8, inner), np.float32)
    three, seven = np.empty(inner, np.float32), np.empty(inner, np.float32)
    pairs, beside = np.empty(inner, np.float32), np.empty(inner, np.float32)
    ninth, forty_ninth, sixth = np.float32(1 / 9), np.float32(1 / 49), np.float32(1 / 6)
    for v in range(top, bottom):
        upper, lower = off[v + shift_v, left + shift_u :], off[v + shift_v + 1, left + shift_u :]
        upper_next, lower_next = upper[1:], lower[1:]
        light, moved, rest = on[v, left:], still[v & 7], difference[v & 7]
        for i in range(inner):
            value = c00 * np.float32(upper[i]) + c01 * np.float32(upper_next[i])
            value += c10 * np.float32(lower[i]) + c11 * np.float32(lower_next[i])
            moved[i] = value
            rest[i] = np.float32(light[i]) - value
        if v < top + 6:
            continue
        m = v - 3
        r0, r1, r2, r3 = difference[(m - 3) & 7], difference[(m - 2) & 7], difference[(m - 1) & 7], difference[m & 7]
        r4, r5, r6 = difference[(m + 1) & 7], difference[(m + 2) & 7], rest
        above, here, below = still[(m - 1) & 7], still[m & 7], still[(m + 1) & 7]
        for i in range(inner):
            middle = r2[i] + r3[i] + r4[i]
            three[i] = middle
            seven[i] = middle + r0[i] + r1[i] + r5[i] + r6[i]
            beside[i] = above[i] + here[i] + below[i]
        seven_next = seven[1:]
        for i in range(inner - 1):
            pairs[i] = seven[i] + seven_next[i]
        p0, p2, p4, s6 = pairs, pairs[2:], pairs[4:], seven[6:]
        t2, t3, t4, b2, b4 = three[2:], three[3:], three[4:], beside[2:], beside[4:]
        a2, a3, a4, d2, d3, d4 = above[2:], above[3:], above[4:], below[2:], below[3:], below[4:]
        out, slope = gain[m - box_top, start:], step[m - box_top, start:]
        for i in range(count):
            out[i] = ninth * (t2[i] + t3[i] + t4[i]) - forty_ninth * (p0[i] + p2[i] + p4[i] + s6[i])
        for i in range(count):
            across, down = b4[i] - b2[i], d2[i] + d3[i] + d4[i] - a2[i] - a3[i] - a4[i]
            slope[i] = sixth * np.sqrt(across * across + down * down)


@compiled
def _noise(gain: Array, most: float) -> float:
    """Standard deviation of the noise in gain (h, w), from the median of a part of it, without what is more than so
    many standard deviations at first sight."""
    height, width = gain.shape
    bins = np.zeros(512, np.int64)
    total = 0
    for v in range(3, height - 3, 3):
        for u in range(3, width - 3, 3):
            value = abs(gain[v, u])
            if value > 0:
                bins[min(int(value * 40), 511)] += 1
                total += 1
    noise = 0.0
    for _ in range(3):
        seen, middle = 0, 0
        while middle < 511 and 2 * (seen + bins[middle]) < total:
            seen += bins[middle]
            middle += 1
        noise = 1.4826 * (middle + 0.5) / 40
        total = 0
        for k in range(min(int(most * noise * 40), 511) + 1):
            total += bins[k]
    return noise


@compiled
def _maxima(gain: Array, step: Array, noise: float, apart: float, threshold: float, mask: Image, left: int, top: int,
            uv: Peaks, level: Array) -> int:  # fmt: skip
    """Write the pixels whose gain is largest among their 5 × 5 and above a threshold, in standard deviations: noise,
    or the step over `apart` px where that is more. gain, step (h, w): of a box that begins at (left, top) of the
    half-size image, whose mask is not zero where peaks may be. Written: uv (m, 2) px of the image of twice the size,
    level (m,); returned: how many."""
    height, width = gain.shape
    count = 0
    least, part, bound = np.float32(noise), np.float32(apart), np.float32(threshold)
    high, places = np.zeros((width + 7) // 8 * 8, np.uint8), np.empty(width + 1, np.int64)
    eights = high.view(np.uint64)
    for v in range(2, height - 2):
        values, slopes, may = gain[v], step[v], mask[top + v, left:]
        for u in range(width):
            high[u] = (values[u] > bound * max(least, part * slopes[u])) & (may[u] > 0)
        found = 0
        for eight in range(len(eights)):
            if eights[eight] == 0:
                continue
            for u in range(max(8 * eight, 2), min(8 * eight + 8, width - 2)):
                places[found] = u
                found += high[u]
        for u in places[:found]:
            if count == len(level):
                continue
            value = values[u] / max(least, part * slopes[u])
            highest = True
            for k in NEAREST:
                b, a = v + k // 5 - 2, u + k % 5 - 2
                other = gain[b, a] / max(least, part * step[b, a])
                if other > value or (other == value and k < 12):
                    highest = False
                    break
            slope = np.float32(0)  # what a step leaves lies beside it, too
            for k in range(9):
                slope += step[v + k // 3 - 1, u + k % 3 - 1] / np.float32(9)
            value = values[u] / max(least, part * slope)
            if highest and value > bound:
                uv[count, 0], uv[count, 1], level[count] = 2 * (left + u), 2 * (top + v), value
                count += 1
    return count
