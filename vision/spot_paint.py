"""Takes laser spots out of an image again, for whoever looks for outlines in it. Compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.compiled import compiled
from vision.dots import Spots
from vision.spot_light import BURNT
from vision.surface_kernels import solve

Array = NDArray[Any]  # of floats

REACH = 5  # px, half the square around a spot


def without_spots(on: Image, off: Image | None, spots: Spots, room: Image | None = None) -> Image:
    """The laser-on image's tones (h, w, c) without its spots: painted over from the laser-off image or its tones, moved
    as `spots.motion` says; without one, each spot as fitted to its surroundings is taken away. room (h, w, c): where to
    write them, which may be the tones themselves; else they are copied."""
    clean = np.empty(on.shape, np.uint8) if room is None else room
    if clean is not on:
        np.copyto(clean, on)
    if len(spots) == 0:
        return clean
    if off is not None:
        _paint_from(
            clean,
            np.ascontiguousarray(off.reshape(*on.shape[:2], -1)),
            np.rint(spots.uv).astype(np.int64),
            spots.motion,
        )
    else:
        _take_away(clean, np.array(on, order="C"), spots.uv, spots.shape)
    return clean


@compiled
def _paint_from(image: Image, off: Image, at: NDArray[np.int64], motion: Array) -> None:
    height, width, channels = image.shape
    step = 2 if off.shape[2] > channels else 1  # of blue, green and red, the outer ones are the tones
    shift_u, shift_v = int(np.floor(-motion[0])), int(np.floor(-motion[1]))
    part_u, part_v = -motion[0] - shift_u, -motion[1] - shift_v
    for n in range(len(at)):
        for v in range(max(at[n, 1] - REACH, 0), min(at[n, 1] + REACH + 1, height)):
            top, low = min(max(v + shift_v, 0), height - 1), min(max(v + shift_v + 1, 0), height - 1)
            for u in range(max(at[n, 0] - REACH, 0), min(at[n, 0] + REACH + 1, width)):
                left, right = min(max(u + shift_u, 0), width - 1), min(max(u + shift_u + 1, 0), width - 1)
                for c in range(channels):
                    at_c = step * c
                    upper = (1 - part_u) * off[top, left, at_c] + part_u * off[top, right, at_c]
                    lower = (1 - part_u) * off[low, left, at_c] + part_u * off[low, right, at_c]
                    image[v, u, c] = np.uint8((1 - part_v) * upper + part_v * lower + 0.5)


@compiled
def _take_away(image: Image, on: Image, uv: Array, shape: Array) -> None:
    height, width, channels = image.shape
    reach = REACH + 2  # what surrounds the spot tells what lies under it
    normal, right = np.empty((4, 4)), np.empty(4)
    terms = np.empty(4)
    for n in range(len(uv)):
        middle_u, middle_v = int(np.floor(uv[n, 0] + 0.5)), int(np.floor(uv[n, 1] + 0.5))
        for c in range(channels):
            normal[:] = 0.0
            right[:] = 0.0
            for v in range(max(middle_v - reach, 0), min(middle_v + reach + 1, height)):
                for u in range(max(middle_u - reach, 0), min(middle_u + reach + 1, width)):
                    if on[v, u, c] < BURNT:
                        x, y = u - uv[n, 0], v - uv[n, 1]
                        terms[0] = np.exp(-0.5 * (shape[0] * x * x + 2 * shape[1] * x * y + shape[2] * y * y))
                        terms[1], terms[2], terms[3] = 1.0, x, y
                        for i in range(4):
                            right[i] += terms[i] * on[v, u, c]
                            for j in range(4):
                                normal[i, j] += terms[i] * terms[j]
            for i in range(4):
                normal[i, i] += 1e-6
            solve(normal, right)
            level = max(right[0], 0.0)
            for v in range(max(middle_v - reach, 0), min(middle_v + reach + 1, height)):
                for u in range(max(middle_u - reach, 0), min(middle_u + reach + 1, width)):
                    x, y = u - uv[n, 0], v - uv[n, 1]
                    bell = np.exp(-0.5 * (shape[0] * x * x + 2 * shape[1] * x * y + shape[2] * y * y))
                    under = image[v, u, c] - level * bell
                    if on[v, u, c] >= BURNT:
                        under = min(right[1] + right[2] * x + right[3] * y, under)
                    image[v, u, c] = np.uint8(min(max(under + 0.5, 0.0), 255.0))
