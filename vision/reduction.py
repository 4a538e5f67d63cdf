"""Full images to the size that is worked on: halved with INTER_AREA until about 612 pixels wide; green, and tones."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import Bayer
from vision.capture import Image
from vision.compiled import compiled
from vision.mosaic import reduce_mosaic

Array = NDArray[Any]  # of floats
WORKING_WIDTH = 620


def reduction_factor(width: int) -> int:
    """The power of two that brings an image of this width to at most about 612 pixels."""
    factor = 1
    while width / factor > WORKING_WIDTH:
        factor *= 2
    return factor


def reduce_image(image: Image, factor: int, bayer: Bayer | None = None) -> Image:
    """The image averaged over blocks of factor × factor pixels; one channel is the mosaic `bayer`, if that is given,
    and comes back as colour."""
    if bayer is not None and image.ndim == 2:
        return reduce_mosaic(image, factor, bayer)
    while factor > 1:
        height, width = image.shape[0] // 2, image.shape[1] // 2
        image = np.asarray(
            cv2.resize(image[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA), np.uint8
        )
        factor //= 2
    return image


def green(image: Image) -> Image:
    """The channel (h, w) in which a green laser shows best; a grey image is its own."""
    return image if image.ndim == 2 else np.asarray(cv2.extractChannel(image, 1), np.uint8)


def tones(image: Image) -> Image:
    """What outlines are sought in, (h, w, 1 or 2): blue and red, in which a grey blade differs from sky, field and
    soil alike and the laser hardly shows; a grey image as it is."""
    if image.ndim == 2:
        return image[:, :, None]
    both = np.empty((*image.shape[:2], 2), np.uint8)
    cv2.mixChannels([image], [both], [0, 0, 2, 1])
    return both


def green_and_tones(image: Image) -> tuple[Image, Image]:
    """Both of an image in one go."""
    if image.ndim == 2:
        return image, image[:, :, None]
    size = image.shape[:2]
    middle, both = np.empty(size, np.uint8), np.empty((*size, 2), np.uint8)
    _apart(np.ascontiguousarray(image).reshape(-1), middle.reshape(-1), both.reshape(-1))
    return middle, both


@compiled
def _apart(image: Image, middle: Image, both: Image) -> None:
    for k in range(len(middle)):
        both[2 * k] = image[3 * k]
        middle[k] = image[3 * k + 1]
        both[2 * k + 1] = image[3 * k + 2]


def to_full(pixels: Array, factor: int) -> Array:
    """Pixels of the working image in pixels of the full image: centres of blocks, not corners."""
    return (np.asarray(pixels, float) + 0.5) * factor - 0.5
