"""Inner loops that sample an image along rows of pixels, along lanes between two edges and before lines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled

Floats = NDArray[Any]
Flags = NDArray[np.bool_]


@compiled
def _sampled(
    image: Floats,
    height: int,
    width: int,
    channels: int,
    count: int,
    room: Floats,
    at: NDArray[np.uint64],
    tone: Floats,
) -> None:
    """Bilinear values, written to tone (c, count), of an image (h, w, c), flat, at pixels u, v in room (2, count); the
    border continues outward. What is in room is lost, and at (count,) is to reckon in: row beside row, for vectors."""
    across, down, below = room[0], room[1], width * channels
    last_u, last_v = width - 1.0, height - 1.0
    beside, under_it = np.uint64(channels), np.uint64(below)  # an index that may be negative is asked whether it is
    for i in range(count):
        u, v = min(max(across[i], 0.0), last_u), min(max(down[i], 0.0), last_v)
        left, top = min(np.floor(u), last_u - 1.0), min(np.floor(v), last_v - 1.0)
        across[i], down[i] = u - left, v - top
        at[i] = np.uint64(int(top * width + left) * channels)
    for c in range(channels):
        values = tone[c]
        for i in range(count):
            k = at[i] + np.uint64(c)
            over = image[k] * (1.0 - across[i]) + image[k + beside] * across[i]
            under = image[k + under_it] * (1.0 - across[i]) + image[k + under_it + beside] * across[i]
            values[i] = over * (1.0 - down[i]) + under * down[i]


@compiled
def steps_between(image: Image, points: Floats, least: float, most: float, shares: Floats) -> Floats:
    """The greatest of the central differences, of the tone of the image (h, w, c) that changes most, among samples at
    some shares (m,) of the way between each two of points (n, 2) px that are farther than least and nearer than most
    px apart."""
    height, width, channels = image.shape
    count = len(shares)
    flat, tone = image.reshape(-1), np.empty((channels, count))
    room, corner = np.empty((2, count)), np.empty(count, np.uint64)
    change, found = np.empty(len(points) * len(points)), 0
    for a in range(len(points)):
        for b in range(a + 1, len(points)):
            apart = np.sqrt((points[b, 0] - points[a, 0]) ** 2 + (points[b, 1] - points[a, 1]) ** 2)
            if not least < apart < most:
                continue
            for i in range(count):
                room[0, i] = points[a, 0] * (1 - shares[i]) + points[b, 0] * shares[i]
                room[1, i] = points[a, 1] * (1 - shares[i]) + points[b, 1] * shares[i]
            _sampled(flat, height, width, channels, count, room, corner, tone)
            change[found] = 0.0
            for c in range(channels):
                for i in range(count - 2):
                    change[found] = max(change[found], abs(tone[c, i + 2] - tone[c, i]))
            found += 1
    return change[:found]


@compiled
def shares_at_depth(
    image: Image, near: Floats, deeper: Floats, far: Floats, normals: Floats, steps: Floats, agrees: Flags,
    beside: Flags, about: float, apart: float, part: float, least: float, fewest: int, samples: int, shares: Floats,
) -> None:  # fmt: skip
    """Share (k,) of the agreeing places of k lines whose step another eye's image (h, w, c) shows at the depth it ought
    to have; NaN where that tells nothing.

    near, deeper, far (k, m, 2): pixels there of every other place along each line at the least depth, the greatest and
    infinitely far off; normals (k, 2). steps, agrees, beside (k, 2 m): of all places, and which of them count. A step
    is looked for on samples across from the least depth to the greatest and `about` px beyond: the mean of three
    places' steps, each of the tone that changes most, has to be `part` of the place's own, and `least` grey levels.
    apart: px on the mean between the greatest depth and infinity, fewest: places that have to count, to tell."""
    lines, places = near.shape[:2]
    height, width, channels = image.shape
    flat, tone = image.reshape(-1), np.empty((channels, samples))
    room, corner = np.empty((2, samples)), np.empty(samples, np.uint64)
    raw = np.empty((places, samples - 2))
    for line in range(lines):
        shares[line] = np.nan
        nx, ny, from_far, counted, shown = normals[line, 0], normals[line, 1], 0.0, 0, 0
        for m in range(places):
            counted += agrees[line, 2 * m] and beside[line, 2 * m]
            from_far += abs((deeper[line, m, 0] - far[line, m, 0]) * nx + (deeper[line, m, 1] - far[line, m, 1]) * ny)
        if not (from_far > apart * places and counted >= fewest):
            continue
        for m in range(places):
            u, v = near[line, m, 0], near[line, m, 1]
            behind = (deeper[line, m, 0] - u) * nx + (deeper[line, m, 1] - v) * ny
            first, step = min(behind, 0.0) - about, (abs(behind) + 2 * about) / (samples - 1)
            for i in range(samples):
                across = first + step * i
                room[0, i], room[1, i] = u + across * nx, v + across * ny
            _sampled(flat, height, width, channels, samples, room, corner, tone)
            row = raw[m]
            for i in range(samples - 2):
                row[i] = tone[0, i + 2] - tone[0, i]
            for c in range(1, channels):
                for i in range(samples - 2):
                    other = tone[c, i + 2] - tone[c, i]
                    row[i] = other if abs(other) > abs(row[i]) else row[i]
        counted = 0
        for m in range(places):
            middle = ((deeper[line, m, 0] - near[line, m, 0]) * nx + (deeper[line, m, 1] - near[line, m, 1]) * ny) / 2
            u, v = near[line, m, 0] + middle * nx, near[line, m, 1] + middle * ny
            inside = (u > 4) & (v > 4) & (u < width - 5) & (v < height - 5)
            if not (inside and agrees[line, 2 * m] and beside[line, 2 * m]):
                continue
            before, here, after = raw[m - 1 if m > 0 else places - 1], raw[m], raw[m + 1 if m + 1 < places else 0]
            most = 0.0
            for i in range(samples - 2):
                most = max(most, abs(here[i] + before[i] + after[i]))
            counted += 1
            shown += most / 3 > max(part * abs(steps[line, 2 * m]), least)
        if counted >= fewest:
            shares[line] = shown / counted


@compiled
def steps_in_lanes(
    image: Image, low: Floats, high: Floats, toward: Floats, skew_px: float, shares: Floats, stations: Floats,
    quiet: Floats, boxes: tuple[int, int], shares_of_step: tuple[float, float], least: float, size: Floats,
) -> None:  # fmt: skip
    """Steps along lanes between two sides of a blade, zero where they are none, are a streak's or outside the image.

    low, high (2,): offset across the direction `toward` (2,) and its change per px along it. shares (lanes,) from the
    low side to the high one, stations (m,) px along, evenly; a lane is skew_px farther along at share 1 than at 0.
    quiet (lanes,): station before which a lane has no step. boxes: samples averaged on each side of a step, and to
    tell it from a streak: there it has to reach these shares of itself and of `least`. Written: size (lanes, m).
    """
    lanes, count = size.shape
    height, width, channels = image.shape
    short, long = boxes
    centre_u, centre_v = (width - 1) / 2, (height - 1) / 2
    wide = count + 2 * long
    flat, tone, sums = image.reshape(-1), np.empty((channels, wide)), np.empty((channels, wide + 1))
    room, corner = np.empty((2, wide)), np.empty(wide, np.uint64)
    brief, lasting, inside = np.empty(count), np.empty(count), np.empty(count)
    for lane in range(lanes):
        share = shares[lane]
        offset = low[0] + share * (high[0] - low[0])
        slope = low[1] + share * (high[1] - low[1])
        ahead = skew_px * (share - 0.5)
        first = 0
        while first < count and stations[first] < quiet[lane]:
            first += 1
        size[lane] = 0.0
        if first == count:
            continue
        begin = max(first - long, 0)  # the first place that is averaged
        for m in range(begin, count):
            across, along = offset + slope * stations[m], stations[m] + ahead
            u = along * toward[0] - across * toward[1] + centre_u
            v = along * toward[1] + across * toward[0] + centre_v
            room[0, m - begin], room[1, m - begin] = u, v
            inside[m] = (u >= 1) & (v >= 1) & (u <= width - 2) & (v <= height - 2)
        _sampled(flat, height, width, channels, count - begin, room, corner, tone)
        brief[:], lasting[:] = 0.0, 0.0
        for c in range(channels):
            total, values, so_far = 0.0, tone[c], sums[c]
            so_far[first] = 0.0
            for i in range(first, wide):
                total += values[min(max(i - long, 0), count - 1) - begin]
                so_far[i + 1] = total
            here, far, back = so_far[long:], so_far[2 * long :], so_far
            near, nearly = so_far[long + short :], so_far[long - short :]
            for m in range(first, count):
                middle = 2 * here[m]
                brief[m] = max(brief[m], abs(near[m] + nearly[m] - middle))
                lasting[m] = max(lasting[m], abs(far[m] + back[m] - middle))
        out = size[lane]
        for m in range(first, count):
            one, other = brief[m] / short, lasting[m] / long
            is_step = (other > shares_of_step[0] * one) & (other > shares_of_step[1] * least)
            out[m] = one * inside[m] if is_step else 0.0


@compiled
def seen_in_lanes(size: Floats, least: float, back: int, slack: int, seen: Floats) -> None:
    """How much of a step there is at each place of each lane, 0 to 1, or `slack` places beside it; less where a clearly
    stronger one lies `back` places or more before it. size, seen (lanes, m)."""
    lanes, count = size.shape
    for lane in range(lanes):
        strongest = 0.0
        for m in range(count):
            if m >= back:
                strongest = max(strongest, size[lane, m - back])
            value = min(max(size[lane, m] / least - 0.5, 0.0), 1.0)
            if strongest > 1.3 * size[lane, m] and strongest > 1.5 * least:
                value *= 0.3
            seen[lane, m] = value
        for _ in range(slack):
            before = seen[lane, 0]
            for m in range(1, count - 1):
                here = seen[lane, m]
                seen[lane, m] = max(here, 0.95 * max(before, seen[lane, m + 1]))
                before = here


@compiled
def steps_before(
    image: Image, normals: Floats, rhos: Floats, places: Floats, depths: Floats, first_px: float, step_px: float,
    change: Floats,
) -> None:  # fmt: skip
    """Steps, written to change (k, m, n - 2), at n samples from first_px inward of each of k lines on, step_px apart,
    at places (k, m) along it; zero farther in than depths (k,)."""
    lines, count, inner = change.shape
    height, width, channels = image.shape
    flat, tone = image.reshape(-1), np.empty((channels, inner + 2))
    room, corner = np.empty((2, inner + 2)), np.empty(inner + 2, np.uint64)
    centre_u, centre_v = (width - 1) / 2, (height - 1) / 2
    for line in range(lines):
        nx, ny = normals[line, 0], normals[line, 1]
        used = 0
        while used < inner and first_px + step_px * (used + 1) < depths[line]:
            used += 1
        for m in range(count):
            change[line, m] = 0.0
            if used == 0:
                continue
            u = rhos[line] * nx - places[line, m] * ny + centre_u
            v = rhos[line] * ny + places[line, m] * nx + centre_v
            for i in range(used + 2):
                inward = first_px + step_px * i
                room[0, i], room[1, i] = u - inward * nx, v - inward * ny
            _sampled(flat, height, width, channels, used + 2, room, corner, tone)
            for i in range(used):
                most = 0.0
                for c in range(channels):
                    most = max(most, abs(tone[c, i + 2] - tone[c, i]))
                change[line, m, i] = most
