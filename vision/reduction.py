"""Full images to the size that is worked on: halved with INTER_AREA until about 612 pixels wide, grey and green."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image

Array = NDArray[np.float64]
WORKING_WIDTH = 620


@dataclass(frozen=True)
class Reduced:
    """One image at working size: `grey` (h, w) for outlines and `green` (h, w), where a green laser shows best."""

    grey: Image
    green: Image


def reduction_factor(width: int) -> int:
    """The power of two that brings an image of this width to at most about 612 pixels."""
    factor = 1
    while width / factor > WORKING_WIDTH:
        factor *= 2
    return factor


def reduce_image(image: Image, factor: int) -> Reduced:
    """Average over blocks of factor × factor pixels, then take grey and green; a grey image serves as both."""
    while factor > 1:
        height, width = image.shape[0] // 2, image.shape[1] // 2
        image = cv2.resize(image[: 2 * height, : 2 * width], (width, height), interpolation=cv2.INTER_AREA)
        factor //= 2
    if image.ndim == 2:
        return Reduced(image, image)
    return Reduced(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.extractChannel(image, 1))


def to_full(pixels: Array, factor: int) -> Array:
    """Pixels of the working image in pixels of the full image: centres of blocks, not corners."""
    return (np.asarray(pixels, float) + 0.5) * factor - 0.5
