"""What motion does to an image: between two exposures, and during one."""

from __future__ import annotations

import cv2
import numpy as np

from vision.capture import Image


def moved(image: Image, shift: tuple[float, float]) -> Image:
    """A copy of an image, its content moved by so many pixels right and down."""
    if max(abs(shift[0]), abs(shift[1])) < 0.02:
        return image.copy()
    height, width = image.shape[:2]
    right, down = int(np.floor(shift[0])), int(np.floor(shift[1]))
    across, along = np.array([shift[0] - right, 1 - shift[0] + right]), np.array([shift[1] - down, 1 - shift[1] + down])
    soft = cv2.sepFilter2D(image, -1, across, along, anchor=(1, 1), borderType=cv2.BORDER_REPLICATE)
    right, down = int(np.clip(right, 1 - width, width - 1)), int(np.clip(down, 1 - height, height - 1))
    kept = soft[max(-down, 0) : height - max(down, 0), max(-right, 0) : width - max(right, 0)]
    sides = (max(down, 0), max(-down, 0), max(right, 0), max(-right, 0))
    return np.asarray(cv2.copyMakeBorder(kept, *sides, cv2.BORDER_REPLICATE), np.uint8)


def smeared(image: Image, path: tuple[float, float]) -> Image:
    """An image blurred along a path of so many pixels right and down, as by motion during the exposure."""
    length = float(np.hypot(*path))
    if length < 0.3:
        return image
    half = int(np.ceil(length / 2))
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    for share in np.linspace(-0.5, 0.5, 8 * half + 1):
        u, v = half + share * path[0], half + share * path[1]
        i, j = int(v), int(u)
        for di, dj in ((0, 0), (0, 1), (1, 0), (1, 1)):
            if i + di <= 2 * half and j + dj <= 2 * half:
                kernel[i + di, j + dj] += (1 - abs(v - i - di)) * (1 - abs(u - j - dj))
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE), np.uint8)
