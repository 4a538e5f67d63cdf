"""Inner loops of straight steps: gradients of the half-size image, votes for lines, profiles across lines."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled

Floats = NDArray[Any]

LEVELS, PER_LEVEL = 4096, 8  # bins in which strengths are counted, and bins per grey level
FOCUS_PX = 160.0  # standard deviation of the weight about the place where a bending edge is to be right
VOTE_PX = 120.0  # the same while a first slope is sought
SLOPES, BINS = 13, 40  # slopes that are tried, and px of offsets in which steps are counted
SLOPE_HELD, BEND_HELD = 0.05, 1e-4  # what a fit of few steps is held to: slope, and change of slope per px over two
OFFSET_HELD = 1e-4  # information about the offset that a fit starts with, 1/px²
LEAST_WEIGHT = 2.0  # of all steps, below which a fit is left as it is
TOLERANCES = (2.0, 1.2, 1.0, 1.0)  # px: how far from the curve steps lose weight, pass by pass
AGREES_PX = 1.5  # from the curve, at which a step is no part of the line


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


@compiled
def _tone(image: Image, u: float, v: float, channel: int) -> Any:
    """Bilinear value of an image (h, w, c) at a pixel; the border continues outward."""
    last_u, last_v = image.shape[1] - 1, image.shape[0] - 1
    u, v = min(max(u, 0.0), last_u), min(max(v, 0.0), last_v)
    x, y = min(int(u), last_u - 1), min(int(v), last_v - 1)
    du, dv = u - x, v - y
    above = image[y, x, channel] * (1.0 - du) + image[y, x + 1, channel] * du
    below = image[y + 1, x, channel] * (1.0 - du) + image[y + 1, x + 1, channel] * du
    return above * (1.0 - dv) + below * dv


@compiled
def _stretch(nx: float, ny: float, rho: float, half_u: float, half_v: float) -> tuple[float, float]:
    """First and last place along a line inside an image of these half extents; equal where it misses it."""
    first, last = -np.inf, np.inf
    for foot, step, half in ((nx * rho, -ny, half_u), (ny * rho, nx, half_v)):
        if abs(step) < 1e-9:
            if abs(foot) > half:
                return 0.0, 0.0
            continue
        one, two = (-half - foot) / step, (half - foot) / step
        first, last = max(first, min(one, two)), min(last, max(one, two))
    return first, max(first, last)


@compiled
def _vote(place: Floats, offset: Floats, weight: Floats, largest: float) -> tuple[float, float]:
    """Shift and slope on which most of the offsets lie, by trying slopes up to the largest and counting offsets."""
    shift, slope, best = 0.0, 0.0, -1.0
    half = BINS // 2
    count = np.empty(BINS)
    for k in range(SLOPES):
        tried = np.tan(largest * (2.0 * k / (SLOPES - 1) - 1.0))
        count[:] = 0.0
        for m in range(len(place)):
            index = int(np.floor(offset[m] - tried * place[m] + 0.5))
            count[min(max(index, 1 - half), half - 1) + half] += weight[m]
        for b in range(2, BINS - 2):
            value = count[b] + 0.6 * (count[b - 1] + count[b + 1]) - 1e-3 * abs(tried)
            if value > best:
                best, slope, shift = value, tried, float(b - half)
    return shift, slope


@compiled
def _solved(info: Floats, y0: float, y1: float, y2: float) -> tuple[float, float, float]:
    """Solution of three normal equations; info: (00, 01, 02, 11, 12, 22) of the positive matrix."""
    l1, l2 = info[1] / info[0], info[2] / info[0]
    d1 = info[3] - l1 * info[1]
    m = (info[4] - l2 * info[1]) / d1
    d2 = info[5] - l2 * info[2] - m * m * d1
    y1 -= l1 * y0
    y2 -= l2 * y0 + m * y1
    c = y2 / d2
    b = y1 / d1 - m * c
    return y0 / info[0] - l1 * b - l2 * c, b, c


@compiled
def refine(
    smooth: Image, normals: Floats, rhos: Floats, focuses: Floats, margin: float, least: float, reach: int,
    largest_slope: float, t: Floats, offset: Floats, step: Floats, agrees: NDArray[np.bool_], fit: Floats,
    spread: Floats,
) -> None:  # fmt: skip
    """The steepest steps across each of k lines and the gently bent curve on which most of them lie.

    smooth (h, w, c); normals (k, 2), rhos (k,) in the image frame; focuses (k,): the place along each line that counts
    most. margin: px along the image border without profiles. least: of a step that is real. largest_slope: rad.
    Written: places t (k, m), offset (k, m) px of each step from the curve, step (k, m) along the normal, agrees
    (k, m), fit (k, 3): offset at the focus, slope, half the bend per px; spread (k, 3): what unit variance of
    the steps makes of offset's and slope's, and the steps' variance.
    """
    lines, samples = t.shape
    channels = smooth.shape[2]
    wide = 2 * reach + 1
    centre_u, centre_v = (smooth.shape[1] - 1) / 2, (smooth.shape[0] - 1) / 2
    tone = np.empty((channels, wide + 2))
    raw, size = np.empty((samples, wide)), np.empty(wide)
    place, near, vote = np.empty(samples), np.empty(samples), np.empty(samples)
    info = np.empty(6)
    for line in range(lines):
        nx, ny, rho = normals[line, 0], normals[line, 1], rhos[line]
        start, end = _stretch(nx, ny, rho, centre_u - margin, centre_v - margin)
        for m in range(samples):
            at = start + (end - start) * (m / (samples - 1))
            t[line, m], place[m] = at, at - focuses[line]
            u, v = rho * nx - at * ny + centre_u, rho * ny + at * nx + centre_v
            for i in range(wide + 2):
                across = i - reach - 1
                for c in range(channels):
                    tone[c, i] = _tone(smooth, u + across * nx, v + across * ny, c)
            for i in range(wide):
                change = tone[0, i + 2] - tone[0, i]
                for c in range(1, channels):
                    other = tone[c, i + 2] - tone[c, i]
                    if abs(other) > abs(change):
                        change = other
                raw[m, i] = change
        for m in range(samples):
            before, after = max(m - 1, 0), min(m + 1, samples - 1)
            best = 1
            for i in range(wide):
                size[i] = abs(0.5 * raw[m, i] + 0.25 * (raw[before, i] + raw[after, i]))
                if 1 < i < wide - 1 and size[i] > size[best]:
                    best = i
            bend = size[best - 1] - 2.0 * size[best] + size[best + 1]
            fraction = 0.5 * (size[best - 1] - size[best + 1]) / bend if bend < 0 else 0.0
            offset[line, m] = best - reach + min(max(fraction, -0.5), 0.5)
            step[line, m] = 0.5 * raw[m, best] + 0.25 * (raw[before, best] + raw[after, best])
            agrees[line, m] = size[best] > least
            near[m] = np.exp(-0.5 * (place[m] / FOCUS_PX) ** 2) if agrees[line, m] else 0.0
            vote[m] = np.exp(-0.5 * (place[m] / VOTE_PX) ** 2) if agrees[line, m] else 0.0
        shift, slope = _vote(place, offset[line], vote, largest_slope)
        curve = 0.0
        for tolerance in TOLERANCES:
            info[:] = 0.0
            y0, y1, y2 = 0.0, 0.0, 0.0
            for m in range(samples):
                x = place[m]
                off = (offset[line, m] - (shift + (slope + curve * x) * x)) / tolerance
                weight = near[m] / (1.0 + off * off) ** 2
                wx = weight * x
                wxx = wx * x
                info[0] += weight
                info[1] += wx
                info[2] += wxx
                info[4] += wxx * x
                info[5] += wxx * x * x
                y0 += weight * offset[line, m]
                y1 += wx * offset[line, m]
                y2 += wxx * offset[line, m]
            enough = info[0] > LEAST_WEIGHT
            info[3] = info[2] + OFFSET_HELD / SLOPE_HELD**2
            info[0] += OFFSET_HELD
            info[5] += 1.0 / BEND_HELD**2
            if enough:
                shift, slope, curve = _solved(info, y0, y1, y2)
        scatter, used = 0.0, 0.0
        for m in range(samples):
            x = place[m]
            residual = offset[line, m] - (shift + (slope + curve * x) * x)
            offset[line, m] = residual
            agrees[line, m] = agrees[line, m] and abs(residual) < AGREES_PX
            if agrees[line, m]:
                scatter += residual * residual * near[m]
                used += near[m]
        fit[line, 0], fit[line, 1], fit[line, 2] = shift, slope, curve
        spread[line, 0] = _solved(info, 1.0, 0.0, 0.0)[0]
        spread[line, 1] = _solved(info, 0.0, 1.0, 0.0)[1]
        spread[line, 2] = scatter / max(used, 1.0)
