"""Inner loops of the search for straight steps: gradients of the half-size image, their ridges, votes for lines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled

Floats = NDArray[Any]

LEVELS, PER_LEVEL = 4096, 8  # bins in which strengths are counted, and bins per grey level


@compiled
def median_roughness(tones: Image) -> float:
    """Median over the image (h, w, c) of what a pixel's first tone differs from its two neighbours, taken twice."""
    height, width = tones.shape[0], tones.shape[1]
    count = np.zeros(1021, np.int64)
    total = 0
    for y in range(1, height, 4):
        for x in range(1, width - 1, 7):
            rough = 2 * np.int64(tones[y, x, 0]) - tones[y, x - 1, 0] - tones[y, x + 1, 0]
            count[abs(rough)] += 1
            total += 1
    seen, lower = 0, -1
    for level in range(len(count)):
        seen += count[level]
        if lower < 0 and 2 * seen >= total:
            lower = level
        if 2 * seen > total:
            return 0.5 * (lower + level)
    return 0.0


@compiled
def gradients(tones: Image, dx: Floats, dy: Floats, strength: Floats) -> None:
    """Sobel gradients of the tone that changes most, in the half-size image of tones (h, w, c) after a 3 × 3 mean.

    Written: dx, dy and strength = ½ (|dx| + |dy|), each (h // 2, w // 2) float32; zero in the outermost two pixels.
    """
    height, width, channels = strength.shape[0], strength.shape[1], tones.shape[2]
    half = np.empty((height, width), np.float32)
    even, odd = np.empty(width, np.float32), np.empty(width, np.float32)
    ninth, quarter, middle = np.float32(1 / 9), np.float32(0.25), np.float32(0.5)
    three, four = np.float32(3), np.float32(4)
    dx[:], dy[:], strength[:] = np.float32(0), np.float32(0), np.float32(0)
    for c in range(channels):
        for y in range(height):
            top, bottom, mean = tones[2 * y], tones[2 * y + 1], half[y]
            for x in range(width):
                left = np.int32(top[2 * x, c]) + np.int32(bottom[2 * x, c])
                mean[x] = quarter * np.float32(left + np.int32(top[2 * x + 1, c]) + np.int32(bottom[2 * x + 1, c]))
        for y in range(2, height - 2):
            first, above, here, below, last = half[y - 2], half[y - 1], half[y], half[y + 1], half[y + 2]
            for x in range(width):
                even[x] = ninth * (first[x] + last[x] + three * (above[x] + below[x]) + four * here[x])
                odd[x] = ninth * (last[x] + below[x] - above[x] - first[x])
            e0, e1, e3, e4 = even[:-4], even[1:], even[3:], even[4:]
            o0, o1, o2, o3, o4 = odd[:-4], odd[1:], odd[2:], odd[3:], odd[4:]
            row_dx, row_dy, row = dx[y, 2:], dy[y, 2:], strength[y, 2:]
            for x in range(width - 4):
                across = e4[x] + e3[x] - e1[x] - e0[x]
                down = o0[x] + o4[x] + three * (o1[x] + o3[x]) + four * o2[x]
                size = middle * (abs(across) + abs(down))
                stronger = size > row[x]
                row_dx[x] = across if stronger else row_dx[x]
                row_dy[x] = down if stronger else row_dy[x]
                row[x] = size if stronger else row[x]


@compiled
def ridge(dx: Floats, dy: Floats, strength: Floats, least: float, most: int) -> tuple[Floats, float]:
    """(u, v, dx, dy) (4, n) of the pixels that are stronger than `least` and than their neighbours across the step, and
    the strength they all reach: about the `most` strongest of them."""
    height, width = strength.shape
    at_least = np.float32(least)
    is_ridge = np.empty(width, np.uint8)
    places = np.empty(strength.size + width, np.int32)
    count = 0
    for y in range(2, height - 2):
        row_dx, row_dy, row = dx[y, 1:], dy[y, 1:], strength[y, 1:]
        above, below, before, after = strength[y - 1, 1:], strength[y + 1, 1:], strength[y], strength[y, 2:]
        for x in range(width - 2):
            upright = abs(row_dx[x]) >= abs(row_dy[x])
            beside = max(before[x], after[x]) if upright else max(above[x], below[x])
            is_ridge[x] = (row[x] > at_least) & (row[x] >= beside)
        for x in range(width - 2):
            places[count] = y * width + x + 1
            count += is_ridge[x]
    flat = strength.ravel()
    if count > most:
        counts = np.zeros(LEVELS, np.int64)
        for k in range(count):
            counts[min(int(flat[places[k]] * PER_LEVEL), LEVELS - 1)] += 1
        level, reached = LEVELS, 0
        while level > 0 and reached < most:
            level -= 1
            reached += counts[level]
        at_least = max(at_least, np.float32(level / PER_LEVEL))
        kept = 0
        for k in range(count):
            places[kept] = places[k]
            kept += int(flat[places[k]] >= at_least)
        count = kept
    found = np.empty((4, count), np.float32)
    flat_dx, flat_dy = dx.ravel(), dy.ravel()
    for k in range(count):
        at = places[k]
        found[0, k], found[1, k], found[2, k], found[3, k] = at % width, at // width, flat_dx[at], flat_dy[at]
    return found, float(at_least)


@compiled
def line_votes(
    position: Floats, angle: Floats, weight: Floats, spread: int, reach: float, rho_step: float, votes: Floats
) -> None:
    """Each pixel's weight added to votes (angles, bins) at its own angle modulo π and `spread` bins beside it.

    position (n, 2) in px, angle (n,) of the gradient, rad. A line's offset rho is in bin (rho + reach) / rho_step + 1.
    """
    angles, bins = votes.shape
    cosine, sine = np.empty(angles), np.empty(angles)
    for a in range(angles):
        cosine[a], sine[a] = np.cos((a + 0.5) * np.pi / angles), np.sin((a + 0.5) * np.pi / angles)
    for k in range(len(position)):
        own = int(np.floor(angle[k] * (angles / np.pi)))
        for step in range(-spread, spread + 1):
            a = own + step
            while a < 0:
                a += angles
            while a >= angles:
                a -= angles
            rho = position[k, 0] * cosine[a] + position[k, 1] * sine[a]
            r = int((rho + reach) / rho_step + 1.5)
            if 0 <= r < bins:
                votes[a, r] += weight[k]
