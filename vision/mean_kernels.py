"""Inner loops that halve an image: the mean of 2 × 2 pixels, of grey or of green, with the other tones apart."""

from __future__ import annotations

import numpy as np

from vision.capture import Image
from vision.compiled import compiled


@compiled
def half_of_grey(image: Image, half: Image) -> None:
    """Means of 2 × 2 pixels of an image (2 h, 2 w), flat; half (h, w)."""
    height, width = half.shape
    for v in range(height):
        upper, lower = image[4 * v * width :], image[(4 * v + 2) * width :]
        out = half[v]
        for u in range(width):
            both = np.uint16(np.uint16(upper[2 * u]) + np.uint16(lower[2 * u]))
            both = np.uint16(both + np.uint16(upper[2 * u + 1]) + np.uint16(lower[2 * u + 1]))
            out[u] = np.uint8((both + np.uint16(2)) >> np.uint16(2))


@compiled
def half_of_green(image: Image, half: Image) -> None:
    """Means of the green of 2 × 2 pixels of an image (2 h, 2 w, 3), flat; half (h, w)."""
    height, width = half.shape
    sums = np.empty(width, np.uint16)
    for v in range(height):
        upper, lower = image[12 * v * width :], image[(12 * v + 6) * width :]
        out = half[v]
        for u in range(width):
            sums[u] = np.uint16(upper[6 * u + 1]) + np.uint16(upper[6 * u + 4])
        for u in range(width):
            both = sums[u] + np.uint16(lower[6 * u + 1]) + np.uint16(lower[6 * u + 4])
            out[u] = np.uint8((both + np.uint16(2)) >> np.uint16(2))


@compiled
def green_and_tones(image: Image, both: Image, half: Image) -> None:
    """As `half_of_green`; and both (8 h w,): blue and red of each pixel."""
    height, width = half.shape
    lines = np.empty((2, 2 * width), np.uint8)
    upper, lower = lines[0], lines[1]
    for v in range(height):
        for i in range(2):
            row, tones, line = image[6 * (2 * v + i) * width :], both[4 * (2 * v + i) * width :], lines[i]
            for u in range(2 * width):
                tones[2 * u] = row[3 * u]
                line[u] = row[3 * u + 1]
                tones[2 * u + 1] = row[3 * u + 2]
        out = half[v]
        for u in range(width):
            left, right = np.uint16(upper[2 * u]) + np.uint16(lower[2 * u]), np.uint16(upper[2 * u + 1])
            out[u] = np.uint8((left + right + np.uint16(lower[2 * u + 1]) + np.uint16(2)) >> np.uint16(2))
