"""The shift between two images of one eye, laser off and laser on: Lucas and Kanade from coarse to fine."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled

Array = NDArray[Any]  # of floats

LARGEST_MOTION = 14.0  # px between laser-off and laser-on
SMALLEST_MOTION = 0.1  # px; less is not told from none
COARSEST = 8  # the coarsest level is the image's size over this
REACH = 2  # px of the coarsest level, beyond the largest motion
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
    motion = _followed(*pairs[0], 2 * middle, 3, 2) if np.hypot(*middle) * 4 > SMALLEST_MOTION else middle * 2
    if not SMALLEST_MOTION < 2 * np.hypot(*motion) < LARGEST_MOTION:
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
    total, count = np.float64(0), 0
    for v in range(margin, height - margin):
        for u in range(margin, width - margin):
            a, b = v + shift_v, u + shift_u
            upper = (1 - part_u) * off[a, b] + part_u * off[a, b + 1]
            lower = (1 - part_u) * off[a + 1, b] + part_u * off[a + 1, b + 1]
            total += min(abs(on[v, u] - (1 - part_v) * upper - part_v * lower), 20.0)
            count += 1
    return total / max(count, 1)


@compiled
def _search(off: Image, on: Image, shift: Array) -> None:
    """Write into shift (2,) the whole pixels at which off, moved by them, differs least from on, the largest
    differences bounded; of like ones, the smaller."""
    height, width = on.shape
    best = np.inf
    for dv in range(-REACH, REACH + 1):
        for du in range(-REACH, REACH + 1):
            total = 0
            for v in range(REACH, height - REACH):
                for u in range(REACH, width - REACH):
                    total += min(abs(np.int64(on[v, u]) - np.int64(off[v - dv, u - du])), 20)
            cost = total * (1 + 0.01 * (du * du + dv * dv))
            if cost < best:
                best = cost
                shift[0], shift[1] = du, dv


@compiled
def _follow(off: Image, on: Image, shift: Array, steps: int, rows: int) -> None:
    """Improve shift (2,) in place: least squares of on(x) = off(x − shift), with Cauchy's weights against dots."""
    height, width = on.shape
    start = shift.copy()
    for _ in range(steps):
        margin = int(max(abs(shift[0]), abs(shift[1]))) + 3
        if 3 * margin > height or 3 * margin > width:
            return
        shift_u, shift_v = int(np.floor(-shift[0])), int(np.floor(-shift[1]))
        part_u, part_v = np.float32(-shift[0] - shift_u), np.float32(-shift[1] - shift_v)
        corner = (1 - part_u) * (1 - part_v), part_u * (1 - part_v), (1 - part_u) * part_v, part_u * part_v
        uu, uv, vv, ru, rv = 1e-3, 0.0, 1e-3, 0.0, 0.0
        for v in range(margin, height - margin, rows):
            for u in range(margin, width - margin):
                a, b = v + shift_v, u + shift_u
                gu = np.float32(on[v, u + 1]) - np.float32(on[v, u - 1])
                gv = np.float32(on[v + 1, u]) - np.float32(on[v - 1, u])
                if gu * gu + gv * gv < 64:
                    continue
                moved = corner[0] * off[a, b] + corner[1] * off[a, b + 1] + corner[2] * off[a + 1, b]
                rest = on[v, u] - moved - corner[3] * off[a + 1, b + 1]
                weight = 1 / (1 + rest * rest / 100)
                uu += weight * gu * gu
                uv += weight * gu * gv
                vv += weight * gv * gv
                ru -= weight * gu * rest
                rv -= weight * gv * rest
        # along the only edge in sight the images tell no shift: there it stays where it began
        held = HELD * (uu + vv)
        uu, vv = uu + held, vv + held
        ru += 0.5 * held * (start[0] - shift[0])
        rv += 0.5 * held * (start[1] - shift[1])
        determinant = uu * vv - uv * uv
        step_u, step_v = 2 * (vv * ru - uv * rv) / determinant, 2 * (uu * rv - uv * ru) / determinant
        shift[0] += min(max(step_u, -1.0), 1.0)
        shift[1] += min(max(step_v, -1.0), 1.0)
        if abs(step_u) + abs(step_v) < 0.01:
            return
