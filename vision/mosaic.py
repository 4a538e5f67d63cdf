"""Raw images of colour cameras: one colour a pixel in 2 × 2 patterns, averaged to colour without ever demosaicing."""

from __future__ import annotations

import cv2
import numpy as np

from vision.camera import Bayer
from vision.capture import Image
from vision.compiled import compiled

RED_AT: dict[Bayer, tuple[int, int]] = {"rggb": (0, 0), "grbg": (0, 1), "gbrg": (1, 0), "bggr": (1, 1)}
"""Row and column of the red pixel in the pattern; the blue one lies across."""


def reduce_mosaic(image: Image, factor: int, bayer: Bayer) -> Image:
    """The mosaic (h, w) as colour (h / factor, w / factor, 3) BGR: the mean of each colour over blocks of factor ×
    factor pixels. Green, in which the laser shows, has its centre of mass in the middle of its block; blue and red are
    off it by half a pixel of the mosaic."""
    if factor == 1:
        return demosaiced(image, bayer)
    row, column = RED_AT[bayer]
    if factor == 2:
        green = cv2.addWeighted(image[row::2, 1 - column :: 2], 0.5, image[1 - row :: 2, column::2], 0.5, 0)
        blue, red = image[1 - row :: 2, 1 - column :: 2], image[row::2, column::2]
        return np.asarray(cv2.merge([np.ascontiguousarray(blue), green, np.ascontiguousarray(red)]), np.uint8)
    reduced = np.empty((image.shape[0] // 4, image.shape[1] // 4, 3), np.uint8)
    _quartered(np.ascontiguousarray(image), row, column, reduced)
    while factor > 4:
        height, width = reduced.shape[0] // 2, reduced.shape[1] // 2
        whole = reduced[: 2 * height, : 2 * width]
        reduced = np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
        factor //= 2
    return reduced


def demosaiced(image: Image, bayer: Bayer) -> Image:
    """The mosaic (h, w) as colour (h, w, 3) BGR, interpolated."""
    # OpenCV names a pattern by the second and third pixel of its second row
    code = {
        "rggb": cv2.COLOR_BayerBG2BGR,
        "grbg": cv2.COLOR_BayerGB2BGR,
        "gbrg": cv2.COLOR_BayerGR2BGR,
        "bggr": cv2.COLOR_BayerRG2BGR,
    }
    return np.asarray(cv2.cvtColor(image, code[bayer]), np.uint8)


@compiled
def _quartered(image: Image, red_row: int, red_column: int, reduced: Image) -> None:
    """Means of each colour over 4 × 4 pixels: rows are added one by one, columns four at a time as one word."""
    height, width = reduced.shape[:2]
    even, odd = np.empty(4 * width, np.uint16), np.empty(4 * width, np.uint16)
    even_words, odd_words = even.view(np.uint64), odd.view(np.uint64)
    low, fold = np.uint64(0xFFFF), np.uint64(32)
    two, three, four = np.uint64(2), np.uint64(3), np.uint64(4)
    at_red, beside = np.uint64(16 * red_column), np.uint64(16 - 16 * red_column)
    flat = reduced.reshape(-1)
    lines = np.empty((3, width), np.uint8)  # colours apart first: only so are they reckoned side by side
    line_blue, line_green, line_red = lines[0], lines[1], lines[2]
    for v in range(height):
        r0, r1, r2, r3 = image[4 * v], image[4 * v + 1], image[4 * v + 2], image[4 * v + 3]
        for i in range(4 * width):
            even[i] = np.uint16(r0[i]) + np.uint16(r2[i])
        for i in range(4 * width):
            odd[i] = np.uint16(r1[i]) + np.uint16(r3[i])
        reds, blues = (odd_words, even_words) if red_row else (even_words, odd_words)
        for u in range(width):
            red, blue = reds[u] + (reds[u] >> fold), blues[u] + (blues[u] >> fold)
            line_blue[u] = np.uint8((((blue >> beside) & low) + two) >> two)
            line_green[u] = np.uint8((((red >> beside) & low) + ((blue >> at_red) & low) + four) >> three)
            line_red[u] = np.uint8((((red >> at_red) & low) + two) >> two)
        out = flat[3 * width * v : 3 * width * (v + 1)]
        for u in range(width):
            out[3 * u] = line_blue[u]
            out[3 * u + 1] = line_green[u]
            out[3 * u + 2] = line_red[u]
