"""Full images to the size that is worked on: halved with INTER_AREA until about 612 pixels wide; green, and tones."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import Bayer
from vision.capture import Image
from vision.mean_kernels import green_and_tones, half_of_green, half_of_grey
from vision.mosaic import reduce_mosaic
from vision.workspace import lent

Array = NDArray[Any]  # of floats
WORKING_WIDTH = 620
GREEN = 1  # channel


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
    return image if image.ndim == 2 else np.asarray(cv2.extractChannel(image, GREEN), np.uint8)


def tones(image: Image) -> Image:
    """What outlines are sought in, (h, w, 1 or 2): blue and red, in which a grey blade differs from sky, field and
    soil alike and the laser hardly shows; a grey image as it is."""
    if image.ndim == 2:
        return image[:, :, None]
    both = np.empty((*image.shape[:2], 2), np.uint8)
    cv2.mixChannels([image], [both], [0, 0, 2, 1])
    return both


def half_green(image: Image) -> Image:
    """The green of an image (h, w) or (h, w, 3), averaged over blocks of 2 × 2 pixels."""
    if image.shape[0] % 2 or image.shape[1] % 2:
        return np.asarray(cv2.resize(green(image), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
    half = np.empty((image.shape[0] // 2, image.shape[1] // 2), np.uint8)
    (half_of_grey if image.ndim == 2 else half_of_green)(np.ascontiguousarray(image).reshape(-1), half)
    return half


def half_green_and_tones(image: Image, purpose: str) -> tuple[Image, Image]:
    """Both of an image in one go; the tones of a colour image are lent for a purpose."""
    if image.ndim == 2 or image.shape[0] % 2 or image.shape[1] % 2:
        return half_green(image), tones(image)
    height, width = image.shape[:2]
    half, both = np.empty((height // 2, width // 2), np.uint8), lent(purpose, (height, width, 2), np.uint8)
    green_and_tones(np.ascontiguousarray(image).reshape(-1), both.reshape(-1), half)
    return half, both


def to_full(pixels: Array, factor: int) -> Array:
    """Pixels of the working image in pixels of the full image: centres of blocks, not corners."""
    return (np.asarray(pixels, float) + 0.5) * factor - 0.5
