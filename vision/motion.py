"""The shift between two images of one eye, laser off and laser on: Lucas and Kanade from coarse to fine."""

from __future__ import annotations

from math import hypot
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled
from vision.flags import GATHER, NUMBER, SET

Array = NDArray[Any]  # of floats

LARGEST_MOTION = 14.0  # px between laser-off and laser-on
SMALLEST_MOTION = 0.1  # px; less is not told from none
COARSEST = 8  # the coarsest level is the image's size over this
REACH = 2  # px of the coarsest level, beyond the largest motion
STEEP = 8  # grey levels over two pixels, from which a pixel tells a shift
HELD = 3e-3  # weight of a level's start against the level's own information
GAIN = 0.97  # a motion must bring the images nearer to each other by this factor


def halved(image: Image) -> Image:
    """The image averaged over blocks of 2 × 2 pixels."""
    return np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)


def shifted(image: Image, motion: Array) -> Image:
    """The image moved by (right, down) px."""
    transform = np.array([[1.0, 0.0, motion[0]], [0.0, 1.0, motion[1]]])
    moved = cv2.warpAffine(
        image, transform, (image.shape[1], image.shape[0]), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(moved, np.uint8)


def motion_between(off: Image, on: Image, guess: Array | None = None) -> Array:
    """Shift (2,) px of the whole images that brings laser-off onto laser-on, from these half-size images (h, w).

    guess (2,) px: the other eye's motion. Zero where the images do not support a shift: it must bring them clearly
    nearer to each other.
    """
    pairs = [(off, on)]
    for _ in range(2):
        pairs.append((halved(pairs[-1][0]), halved(pairs[-1][1])))
    start = np.zeros(2) if guess is None else np.asarray(guess, float) / COARSEST
    if not start.any():
        _search(*pairs[2], start)
    middle = _followed(*pairs[1], 2 * _followed(*pairs[2], start, 4), 6)
    motion = _followed(*pairs[0], 2 * middle, 3, 2) if hypot(middle[0], middle[1]) * 4 > SMALLEST_MOTION else middle * 2
    if not SMALLEST_MOTION < 2 * hypot(motion[0], motion[1]) < LARGEST_MOTION:
        return np.zeros(2)
    if _difference(*pairs[1], motion / 2) > GAIN * _difference(*pairs[1], np.zeros(2)):
        return np.zeros(2)
    return 2 * motion


def _followed(off: Image, on: Image, start: Array, steps: int, rows: int = 1) -> Array:
    shift = np.array(start, float)
    _follow(off, on, shift, steps, rows)
    return shift


def _difference(off: Image, on: Image, shift: Array) -> float:
    return float(_mean_difference(off, on, float(shift[0]), float(shift[1])))


@compiled
def _mean_difference(off: Image, on: Image, du: float, dv: float) -> float:
    """Mean absolute difference of on and off moved by (du, dv), the largest differences bounded."""
    height, width = on.shape
    margin = int(max(abs(du), abs(dv))) + 2
    shift_u, shift_v = int(np.floor(-du)), int(np.floor(-dv))
    part_u, part_v = np.float32(-du - shift_u), np.float32(-dv - shift_v)
    one = np.float32(1)
    c00, c01 = (one - part_u) * (one - part_v), part_u * (one - part_v)
    c10, c11 = (one - part_u) * part_v, part_u * part_v
    total, count = 0.0, width - 2 * margin
    for v in range(margin, height - margin):
        here = on[v, margin:]
        upper, lower = off[v + shift_v, margin + shift_u :], off[v + shift_v + 1, margin + shift_u :]
        upper_next, lower_next = upper[1:], lower[1:]
        row = np.int32(0)
        for i in range(count):
            value = c00 * np.float32(upper[i]) + c01 * np.float32(upper_next[i])
            value += c10 * np.float32(lower[i]) + c11 * np.float32(lower_next[i])
            row += np.int32(min(abs(np.float32(here[i]) - value), np.float32(20)) * np.float32(64))
        total += row
    mean: float = total / 64 / max(count * (height - 2 * margin), 1)
    return mean


@compiled
def _search(off: Image, on: Image, shift: Array) -> None:
    """Write into shift (2,) the whole pixels at which off, moved by them, differs least from on, the largest
    differences bounded; of like ones, the smaller."""
    height, width = on.shape
    best = np.inf
    for dv in range(-REACH, REACH + 1):
        for du in range(-REACH, REACH + 1):
            total = 0.0
            for v in range(REACH, height - REACH):
                here, there = on[v, REACH:], off[v - dv, REACH - du :]
                row = np.int32(0)
                for i in range(width - 2 * REACH):
                    row += min(abs(np.int32(here[i]) - np.int32(there[i])), np.int32(20))
                total += row
            cost = total * (1 + 0.01 * (du * du + dv * dv))
            if cost < best:
                best = cost
                shift[0], shift[1] = du, dv


@compiled
def _follow(off: Image, on: Image, shift: Array, steps: int, rows: int) -> None:
    """Improve shift (2,) in place: least squares of on(x) = off(x − shift) on every so many rows, where `on` is steep,
    with Cauchy's weights against dots."""
    height, width = on.shape
    margin = int(max(abs(shift[0]), abs(shift[1]))) + 6
    if 3 * margin > height or 3 * margin > width:
        return
    # where `on` is steep: how far its pixels are from the first one, and its slopes
    places = np.empty(((height - 2 * margin) // rows + 1) * (width - 2 * margin) + 8, np.int32)
    count, inner = 0, width - 2 * margin
    steep = np.zeros((inner + 7) // 8 * 8, np.uint8)
    eights = steep.view(np.uint64)
    for v in range(margin, height - margin, rows):
        above, below = on[v - 1, margin:], on[v + 1, margin:]
        before, after = on[v, margin - 1 :], on[v, margin + 1 :]
        for i in range(inner):
            gu, gv = np.int32(after[i]) - np.int32(before[i]), np.int32(below[i]) - np.int32(above[i])
            steep[i] = gu * gu + gv * gv >= STEEP * STEEP
        for eight in range(len(eights)):  # each eighth flag is a bit of a byte that tells where the set ones are
            byte = (eights[eight] * GATHER) >> np.uint64(56)
            first, found, room = np.int32(v * width + margin + 8 * eight), SET[byte], places[count:]
            for k in range(8):
                room[k] = first + np.int32(found[k])
            count += NUMBER[byte]
    flat_on, flat_off = on.ravel(), off.ravel()
    room = np.empty((9, count), np.float32)
    slope_u, slope_v, light, rest = room[0], room[1], room[2], room[3]
    uus, uvs, vvs, rus, rvs = room[4], room[5], room[6], room[7], room[8]
    for k in range(count):
        at = places[k]
        slope_u[k] = np.int32(flat_on[at + 1]) - np.int32(flat_on[at - 1])
        slope_v[k] = np.int32(flat_on[at + width]) - np.int32(flat_on[at - width])
        light[k] = flat_on[at]
    one, part = np.float32(1), np.float32(0.01)
    start_u, start_v = shift[0], shift[1]
    for _ in range(steps):
        shift_u, shift_v = int(np.floor(-shift[0])), int(np.floor(-shift[1]))
        part_u, part_v = np.float32(-shift[0] - shift_u), np.float32(-shift[1] - shift_v)
        c00, c01 = (one - part_u) * (one - part_v), part_u * (one - part_v)
        c10, c11 = (one - part_u) * part_v, part_u * part_v
        apart = shift_v * width + shift_u
        for k in range(count):
            at = places[k] + apart
            moved = c00 * np.float32(flat_off[at]) + c01 * np.float32(flat_off[at + 1])
            moved += c10 * np.float32(flat_off[at + width]) + c11 * np.float32(flat_off[at + width + 1])
            rest[k] = light[k] - moved
        for k in range(count):
            gu, gv = slope_u[k], slope_v[k]
            weight = one / (one + rest[k] * rest[k] * part)
            uus[k], uvs[k], vvs[k] = weight * gu * gu, weight * gu * gv, weight * gv * gv
            rus[k], rvs[k] = weight * gu * rest[k], weight * gv * rest[k]
        uu, uv, vv, ru, rv = 1e-3, 0.0, 1e-3, 0.0, 0.0
        for k in range(count):
            uu += uus[k]
            uv += uvs[k]
            vv += vvs[k]
            ru -= rus[k]
            rv -= rvs[k]
        # along the only edge in sight the images tell no shift: there it stays where it began
        held = HELD * (uu + vv)
        uu, vv = uu + held, vv + held
        ru += 0.5 * held * (start_u - shift[0])
        rv += 0.5 * held * (start_v - shift[1])
        determinant = uu * vv - uv * uv
        step_u, step_v = 2 * (vv * ru - uv * rv) / determinant, 2 * (uu * rv - uv * ru) / determinant
        bound = margin - 2.0
        shift[0] = min(max(shift[0] + min(max(step_u, -1.0), 1.0), -bound), bound)
        shift[1] = min(max(shift[1] + min(max(step_v, -1.0), 1.0), -bound), bound)
        if abs(step_u) + abs(step_v) < 0.01:
            return
