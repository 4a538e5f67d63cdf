"""Inner loops of the search for straight steps: gradients of the half-size image, their ridges, votes for lines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled
from vision.flags import GATHER, NUMBER, SET

Floats = NDArray[Any]
Integers = NDArray[Any]

SUM = 36  # what a gradient is written as, in grey levels per px of the half-size image
LEVEL, LEVELS = 9, 5441  # strengths that are counted as one, and how many such there are


@compiled
def median_roughness(tones: Image) -> float:
    """Median over the image (h, w, c) of what a pixel's first tone differs from its two neighbours, taken twice."""
    height, width, channels = tones.shape
    step = width * channels
    count = np.zeros(1021, np.int64)
    total, flat = 0, tones.reshape(-1)
    for y in range(1, height, 4):
        before, here, after = flat[y * step :], flat[y * step + channels :], flat[y * step + 2 * channels :]
        for x in range(0, (width - 2) * channels, 7 * channels):
            rough = 2 * np.int32(here[x]) - np.int32(before[x]) - np.int32(after[x])
            count[np.uint32(abs(rough))] += 1
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
def gradients(tones: Image, dx: Integers, dy: Integers, strength: Integers) -> None:
    """Sobel gradients of the tone that changes most, in the half-size image of tones (h, w, c) after a 3 × 3 mean.

    Written: dx, dy (h // 2, w // 2) int16, in grey levels per px times SUM, and strength = |dx| + |dy| uint16; zero in
    the outermost two pixels. Nothing is rounded: sixteen bits hold the sums.
    """
    height, width = strength.shape
    channels, step = tones.shape[2], tones.shape[1] * tones.shape[2]
    flat = tones.reshape(-1)
    half = np.empty((8, width), np.int16)  # of the last rows, sums of 2 × 2 pixels
    even, odd = np.empty(width, np.int16), np.empty(width, np.int16)
    for y in range(height):
        border = y < 2 or y >= height - 2
        for x in range(width if border else 4):
            at = x if border or x < 2 else width - 4 + x
            dx[y, at], dy[y, at], strength[y, at] = 0, 0, 0
    for c in range(channels):
        for y in range(height):
            top, bottom, sums = flat[2 * y * step + c :], flat[(2 * y + 1) * step + c :], half[y & 7]
            if channels == 1:  # loops of their own, so that each has a stride that is known
                for x in range(width):
                    left = np.int16(top[2 * x]) + np.int16(bottom[2 * x])
                    sums[x] = np.int16(left + np.int16(top[2 * x + 1]) + np.int16(bottom[2 * x + 1]))
            elif channels == 2:
                for x in range(width):
                    left = np.int16(top[4 * x]) + np.int16(bottom[4 * x])
                    sums[x] = np.int16(left + np.int16(top[4 * x + 2]) + np.int16(bottom[4 * x + 2]))
            else:
                for x in range(width):
                    at = 2 * channels * x
                    left = np.int16(top[at]) + np.int16(bottom[at])
                    sums[x] = np.int16(left + np.int16(top[at + channels]) + np.int16(bottom[at + channels]))
            if y < 4:
                continue
            first, above, here, below = half[(y - 4) & 7], half[(y - 3) & 7], half[(y - 2) & 7], half[(y - 1) & 7]
            for x in range(width):
                even[x] = np.int16(first[x] + sums[x] + 3 * (above[x] + below[x]) + 4 * here[x])
            for x in range(width):
                odd[x] = np.int16(sums[x] + below[x] - above[x] - first[x])
            e0, e1, e3, e4 = even[:-4], even[1:], even[3:], even[4:]
            o0, o1, o2, o3, o4 = odd[:-4], odd[1:], odd[2:], odd[3:], odd[4:]
            row_dx, row_dy, row = dx[y - 2, 2:], dy[y - 2, 2:], strength[y - 2, 2:]
            if c == 0:
                for x in range(width - 4):
                    row_dx[x] = np.int16(e4[x] + e3[x] - e1[x] - e0[x])
                for x in range(width - 4):
                    row_dy[x] = np.int16(o0[x] + o4[x] + 3 * (o1[x] + o3[x]) + 4 * o2[x])
                for x in range(width - 4):
                    row[x] = np.uint16(abs(row_dx[x]) + abs(row_dy[x]))
                continue
            for x in range(width - 4):
                across = np.int16(e4[x] + e3[x] - e1[x] - e0[x])
                down = np.int16(o0[x] + o4[x] + 3 * (o1[x] + o3[x]) + 4 * o2[x])
                size = np.uint16(abs(across) + abs(down))
                stronger = size > row[x]
                row_dx[x] = across if stronger else row_dx[x]
                row_dy[x] = down if stronger else row_dy[x]
                row[x] = size if stronger else row[x]


@compiled
def ridge(dx: Integers, dy: Integers, strength: Integers, least: int, most: int) -> Floats:
    """(u, v, angle, weight) (4, n) of the pixels that are stronger than `least` and than their neighbours across the
    step, about the `most` strongest of them. angle: of the gradient, rad, to 3e-4; weight: at most one, which ten times
    the strength has that they all reach."""
    height, width = strength.shape
    at_least = np.uint16(least)
    flags = np.zeros((width + 5) // 8 * 8, np.uint8)
    eights = flags.view(np.uint64)
    places = np.empty(strength.size + 8, np.int32)
    count = 0
    for y in range(2, height - 2):
        row_dx, row_dy, row = dx[y, 1:], dy[y, 1:], strength[y, 1:]
        above, below, before, after = strength[y - 1, 1:], strength[y + 1, 1:], strength[y], strength[y, 2:]
        for x in range(width - 2):
            beside, over = max(before[x], after[x]), max(above[x], below[x])
            upright = np.uint16(abs(row_dx[x])) >= np.uint16(abs(row_dy[x]))
            highest = beside if upright else over
            flags[x] = np.uint8((row[x] > at_least) & (row[x] >= highest))
        for eight in range(len(eights)):  # each eighth flag is a bit of a byte that tells where the set ones are
            byte = (eights[eight] * GATHER) >> np.uint64(56)
            first = np.int32(y * width + 1 + 8 * eight)
            found, room = SET[byte], places[count:]
            for k in range(8):
                room[k] = first + np.int32(found[k])
            count += NUMBER[byte]
    flat = strength.ravel()
    if count > most:
        counts = np.zeros(LEVELS, np.int64)
        for k in range(count):
            counts[flat[places[k]] // LEVEL] += 1
        level, reached = LEVELS, 0
        while level > 0 and reached < most:
            level -= 1
            reached += counts[level]
        at_least = max(at_least, np.uint16(LEVEL * level))
        kept = 0
        for k in range(count):
            places[kept] = places[k]
            kept += int(flat[places[k]] >= at_least)
        count = kept
    pixels = np.empty((4, count), np.float32)
    flat_dx, flat_dy = dx.ravel(), dy.ravel()
    u, v, angle, weight = pixels[0], pixels[1], pixels[2], pixels[3]
    for k in range(count):
        at = places[k]
        angle[k], weight[k] = flat_dx[at], flat_dy[at]
    none, one, right, straight = np.float32(0), np.float32(1), np.float32(np.pi / 2), np.float32(np.pi)
    full = np.float32(1 / (5 * np.float32(at_least)))
    c3, c2, c1 = np.float32(-0.0464964749), np.float32(0.15931422), np.float32(-0.327622764)
    for k in range(count):
        row_number = np.floor((places[k] + 0.5) * (1.0 / width))
        u[k], v[k] = places[k] - row_number * width, row_number
    for k in range(count):
        x, y = angle[k], weight[k]
        wide, high = abs(x), abs(y)
        part = min(wide, high) / max(wide, high)
        square = part * part
        turn = ((c3 * square + c2) * square + c1) * square * part + part
        turn = right - turn if high > wide else turn
        turn = straight - turn if x < none else turn
        angle[k] = -turn if y < none else turn
        weight[k] = min(np.sqrt(x * x + y * y) * full, one)
    return pixels


@compiled
def line_votes(
    pixels: Floats, first: tuple[float, float], spread: int, reach: float, rho_step: float, votes: Floats
) -> None:
    """Written: the weight of each pixel, of n as of `ridge`, in votes (angles, bins) at its own angle modulo π and
    `spread` bins beside it. first: place of the first pixel in the image frame of the image of twice the size, px; a
    line's offset rho there is in bin (rho + reach) / rho_step + 1."""
    angles, bins = votes.shape
    cosine, sine = np.empty(angles), np.empty(angles)
    for a in range(angles):
        cosine[a], sine[a] = np.cos((a + 0.5) * np.pi / angles), np.sin((a + 0.5) * np.pi / angles)
    u, v, angle, weight = pixels[0], pixels[1], pixels[2], pixels[3]
    count, ways = pixels.shape[1], 2 * spread + 1
    # loop by loop, so that all but gathering and adding is reckoned side by side
    turn, place = np.empty(count, np.uint32), np.empty((ways, count), np.uint32)
    across, down = np.empty(count), np.empty(count)
    per_rad, per_px, nowhere = angles / np.pi, 1 / rho_step, np.uint32(votes.size)
    for way in range(ways):
        row = place[way]
        for k in range(count):
            own = np.int32(np.floor(angle[k] * per_rad)) + np.int32(way - spread)
            once = own + np.int32(angles) if own < 0 else own
            twice = once + np.int32(angles) if once < 0 else once
            turn[k] = twice - np.int32(angles) if twice >= angles else twice
        for k in range(count):
            across[k], down[k] = cosine[turn[k]], sine[turn[k]]
        for k in range(count):
            x, y = 2.0 * u[k] + first[0], 2.0 * v[k] + first[1]
            r = np.int32((x * across[k] + y * down[k] + reach) * per_px + 1.5)
            row[k] = np.uint32(turn[k] * bins + r) if (r >= 0) & (r < bins) else nowhere
    flat = np.zeros(votes.size + 1, np.float32)
    for k in range(count):
        for way in range(ways):
            flat[place[way, k]] += weight[k]
    for a in range(angles):
        for column in range(bins):
            votes[a, column] = flat[a * bins + column]


@compiled
def line_peaks(
    votes: Floats, least: float, angle: NDArray[np.int64], place: NDArray[np.int64], strength: Floats
) -> int:
    """Peaks of votes (angles, bins), smoothed over three bins, that are more than `least` and the highest among three
    angles and five bins, as they are or smoothed: of two lines side by side the smoothed ones tell only one. Past the
    last angle lies the first with its bins turned round. Written: angle and place (m,)
    of each and its strength (m,); returned: how many, at most m."""
    angles, bins = votes.shape
    smooth = np.zeros((angles + 2, bins + 4), np.float32)
    third = np.float32(1 / 3)
    for a in range(angles):
        row, out = votes[a], smooth[a + 1]
        for r in range(1, bins - 1):
            out[r + 2] = (row[r - 1] + row[r] + row[r + 1]) * third
        out[2] = (row[0] + row[1] + row[1]) * third
        out[bins + 1] = (row[bins - 1] + row[bins - 2] + row[bins - 2]) * third
    for r in range(bins):
        smooth[0, r + 2], smooth[angles + 1, r + 2] = smooth[angles, bins + 1 - r], smooth[1, bins + 1 - r]
    count = 0
    for a in range(angles):
        over, here, under = smooth[a], smooth[a + 1], smooth[a + 2]
        for r in range(bins):
            value = here[r + 2]
            if value <= least or count == len(angle):
                continue
            highest = True
            for k in range(5):
                highest &= (over[r + k] <= value) & (here[r + k] <= value) & (under[r + k] <= value)
            if not highest and votes[a, r] > value:
                highest = True
                for k in range(max(r - 2, 0), min(r + 3, bins)):
                    highest &= votes[a, k] <= votes[a, r]
                    highest &= (a == 0) | (votes[a - 1, k] <= votes[a, r])
                    highest &= (a == angles - 1) | (votes[(a + 1) % angles, k] <= votes[a, r])
            if highest:
                angle[count], place[count], strength[count] = a, r, value
                count += 1
    return count
