"""Inner loops that fit lines to an image: the steepest steps on profiles across each, and the curve most lie on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled

Floats = NDArray[Any]

FOCUS_PX = 160.0  # standard deviation of the weight about the place where a bending edge is to be right
VOTE_PX = 120.0  # the same while a first slope is sought
SLOPES, BINS = 13, 40  # slopes that are tried, and px of offsets in which steps are counted
SLOPE_HELD, BEND_HELD = 0.05, 1e-4  # what a fit of few steps is held to: slope, and change of slope per px over two
OFFSET_HELD = 1e-4  # information about the offset that a fit starts with, 1/px²
LEAST_WEIGHT = 2.0  # of all steps, below which a fit is left as it is
TOLERANCES = (2.0, 1.2, 1.0, 1.0)  # px: how far from the curve steps lose weight, pass by pass
LEAST_SCATTER_PX, LEAST_SIGMA_PX = 0.1, 0.04  # of steps about their line, and of a line: what no fit falls below
AGREES_PX = 1.5  # from the curve, at which a step is no part of the line


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
def stretches(normals: Floats, rhos: Floats, half: Floats, first: Floats, last: Floats) -> None:
    """First and last place (k,) along each line inside an image of half extents `half` (2,); equal where it misses
    it."""
    for line in range(len(rhos)):
        first[line], last[line] = _stretch(normals[line, 0], normals[line, 1], rhos[line], half[0], half[1])


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
    largest_slope: float, t: Floats, offset: Floats, step: Floats, agrees: NDArray[np.bool_], fitted: Floats,
    normal: Floats,
) -> None:  # fmt: skip
    """The steepest steps across each of k lines and the gently bent curve on which most of them lie.

    smooth (h, w, c); normals (k, 2), rhos (k,) in the image frame; focuses (k,): the place along each line that counts
    most. margin: px along the image border without profiles. least: of a step that is real. largest_slope: rad.
    Written: places t (k, m), offset (k, m) px of each step from the curve, step (k, m) along the normal, agrees
    (k, m), normal (k, 2) of the curve's tangent at the focus, and fitted (4, k): its offset, the bend per px, and the
    standard deviations of the slope and of the offset.
    """
    lines, samples = t.shape
    height, width, channels = smooth.shape
    flat, wide = smooth.reshape(-1), 2 * reach + 1
    per_place, count = wide + 2, samples * (wide + 2)
    room, corner = np.empty((2, count)), np.empty(count, np.uint64)
    centre_u, centre_v = (width - 1) / 2, (height - 1) / 2
    tone = np.empty((channels, count))
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
            across_u, down_v = room[0, m * per_place :], room[1, m * per_place :]
            for i in range(per_place):
                across = i - reach - 1
                across_u[i], down_v[i] = u + across * nx, v + across * ny
        _sampled(flat, height, width, channels, count, room, corner, tone)
        for m in range(samples):
            row, values = raw[m], tone[0, m * per_place :]
            for i in range(wide):
                row[i] = values[i + 2] - values[i]
            for c in range(1, channels):
                values = tone[c, m * per_place :]
                for i in range(wide):
                    other = values[i + 2] - values[i]
                    row[i] = other if abs(other) > abs(row[i]) else row[i]
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
        # neighbouring profiles share pixels: three of them count as one, as near as can be told
        variance = 2 * (scatter / max(used, 1.0) + LEAST_SCATTER_PX**2)
        turn = 1.0 / np.sqrt(1.0 + slope * slope)
        normal[line, 0], normal[line, 1] = turn * (nx + slope * ny), turn * (ny - slope * nx)
        foot_u, foot_v = nx * (rho + shift) - ny * focuses[line], ny * (rho + shift) + nx * focuses[line]
        fitted[0, line] = normal[line, 0] * foot_u + normal[line, 1] * foot_v
        fitted[1, line] = 2 * curve
        fitted[2, line] = np.sqrt(variance * _solved(info, 0.0, 1.0, 0.0)[1])
        fitted[3, line] = np.sqrt(variance * _solved(info, 1.0, 0.0, 0.0)[0] + LEAST_SIGMA_PX**2)
