"""How sharp and how bright the blade is in an image."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate
from vision.capture import Image
from vision.compiled import compiled

Array = NDArray[Any]  # of floats

ACROSS, ENDS = 15, 4  # samples across a step, one px apart, and how many at either end tell its height
LEAST_RISE = 2.0  # grey levels
DARKEST, BRIGHTEST = 12.0, 245.0  # mean grey beyond which hardly anything can be told
SHARPEST = 0.55  # of a step's height, gained within one pixel of a sharp image at working size


def exposure(image: Image, pixels: Array) -> float:
    """Mean grey of a laser-off image at pixels (n, 2), 0 to 255."""
    if len(pixels) == 0:
        return 0.0
    last = np.array(image.shape[1::-1]) - 1
    at = np.minimum(np.maximum(np.rint(pixels), 0), last).astype(int)
    return float(image[at[:, 1], at[:, 0]].mean())


def brightness(image: Image) -> float:
    """Mean grey of a whole image (h, w) or (h, w, c) of bytes, 0 to 255, by every eighth row and column."""
    return float(image[::8, ::8].mean()) if image.size else 0.0


def ill_lit(grey: float) -> tuple[str, ...]:
    """What is wrong with an image of so bright a mean, in words, where that is why nothing is found in it."""
    if grey < DARKEST:
        return (f"the image is dark: its mean grey is {grey:.0f} of 255",)
    return (f"the image is overexposed: its mean grey is {grey:.0f} of 255",) if grey > BRIGHTEST else ()


def sharpness(image: Image, edges: tuple[Candidate, ...]) -> float:
    """0 (blurred) to 1: how steep the edges are, against their height. 0 without an edge to judge by."""
    best = 0.0
    centre = np.array([(image.shape[1] - 1) / 2, (image.shape[0] - 1) / 2])
    for edge in edges:
        profile, k = edge.profile, edge.index
        agrees = profile.agrees[k]
        places, offset = profile.t[k][agrees][::3], profile.offset[k][agrees][::3]
        if len(places) < 4:
            continue
        points = edge.outward * edge.rho + places[:, None] * profile.direction[k] + centre
        points += offset[:, None] * edge.outward
        best = max(best, _steepness(image, points, edge.outward))
    return min(best / SHARPEST, 1.0)


@compiled
def _steepness(image: Image, points: Array, normal: Array) -> float:
    """The steepest change per px across a step, over its height: of the mean of what samples along the normal (2,) show
    about each of some points (n, 2) px, in the tone that changes most; 0 where the step is too low to tell."""
    height, width, channels = image.shape
    count = len(points)
    values = np.empty((channels, count, ACROSS))
    for n in range(count):
        for i in range(ACROSS):
            u = min(max(points[n, 0] + (i - ACROSS // 2) * normal[0], 0.0), width - 1.0)
            v = min(max(points[n, 1] + (i - ACROSS // 2) * normal[1], 0.0), height - 1.0)
            x, y = min(int(u), width - 2), min(int(v), height - 2)
            du, dv = u - x, v - y
            for c in range(channels):
                above = image[y, x, c] * (1 - du) + image[y, x + 1, c] * du
                below = image[y + 1, x, c] * (1 - du) + image[y + 1, x + 1, c] * du
                values[c, n, i] = above * (1 - dv) + below * dv
    most, clearest, rises = -1.0, 0, np.empty((channels, count))
    for c in range(channels):
        total = 0.0
        for n in range(count):
            rise = 0.0
            for i in range(ENDS):
                rise += values[c, n, ACROSS - 1 - i] - values[c, n, i]
            rises[c, n] = rise / ENDS
            total += rises[c, n]
        if abs(total) > most:
            most, clearest = abs(total), c
    mean = np.zeros(ACROSS)
    for n in range(count):
        sign = np.sign(rises[clearest, n])
        for i in range(ACROSS):
            mean[i] += sign * values[clearest, n, i] / count
    height_of_step, steepest = 0.0, 0.0
    for i in range(ENDS):
        height_of_step += (mean[ACROSS - 1 - i] - mean[i]) / ENDS
    for i in range(ACROSS - 1):
        steepest = max(steepest, mean[i + 1] - mean[i])
    return steepest / height_of_step if height_of_step > LEAST_RISE else 0.0
