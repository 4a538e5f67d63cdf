"""What the sensor makes of a drawn image: laser spots, vignette, noise."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.world.settings import Lens
from vision.capture import Image
from vision.compiled import compiled

Array = NDArray[np.float64]
NOISE_OFFSETS = 1 << 20
GREEN = (0.30, 1.0, 0.22)  # what blue, green and red pixels make of the laser's light


@compiled
def add_spots(
    image: Any, centres: Any, amplitude: Any, sigma: Any, streak: Any, own: Any, seen: Any, part: Any, shift: Any
) -> None:
    """Add Gaussian spots of green light to image (h, w, 3): centres (n, 2) px, amplitude (n,) grey values, sigma (n,)
    and streak (n,) px, by which a spot is longer to the right than high. Values saturate at 255.

    Light falls only on the part own (n,) that a spot lies on, as far as seen (of `raster.visibility`, or empty) and
    part (triangles,) tell: at an edge the rest of the beam goes past. shift (2,): whole pixels right and down by which
    the image was moved since `seen`.
    """
    height, width = image.shape[:2]
    factor = seen.shape[0] // height
    for i in range(len(centres)):
        u, v, s, long = centres[i, 0], centres[i, 1], sigma[i], streak[i]
        reach = 3.5 * s
        for y in range(max(int(np.ceil(v - reach)), 0), min(int(np.floor(v + reach)), height - 1) + 1):
            begin, end = max(int(np.ceil(u - reach - long / 2)), 0), min(int(np.floor(u + reach + long / 2)), width - 1)
            for x in range(begin, end + 1):
                if factor > 0:
                    row = min(max(y - shift[1], 0), height - 1) * factor
                    column = min(max(x - shift[0], 0), width - 1) * factor
                    t = seen[row + factor - 1, column + factor - 1]
                    if t < 0 or part[t] != own[i]:
                        continue
                away = max(abs(x - u) - long / 2, 0.0)
                value = amplitude[i] * np.exp(-(away * away + (y - v) ** 2) / (2 * s * s))
                for c in range(3):
                    image[y, x, c] = min(int(image[y, x, c] + value * GREEN[c] + 0.5), 255)


class Sensor:
    """Vignette, noise and, for a grey camera, the loss of colour, laid over images of one size."""

    def __init__(self, width: int, height: int, settings: Lens, seed: int) -> None:
        v, u = np.mgrid[0:height, 0:width]
        r2 = ((u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2)
        self._fall = np.repeat(np.round(255 * (1 - settings.vignette * r2)).astype(np.uint8)[..., None], 3, axis=2)
        self._shape = (height, width, 3)
        self._colour = settings.colour
        self._seed = seed
        random = np.random.default_rng([seed, 3])
        noise = random.standard_normal(height * width * 3 + NOISE_OFFSETS, dtype=np.float32)
        rounded = np.round(noise * settings.noise)
        self._above = np.clip(rounded, 0, 255).astype(np.uint8)
        self._below = np.clip(-rounded, 0, 255).astype(np.uint8)

    def darkened(self, image: Image) -> Image:
        """The image (h, w, 3) with less light toward its corners."""
        return np.asarray(cv2.multiply(image, self._fall, scale=1 / 255), np.uint8)

    def exposed(self, image: Image, number: int) -> Image:
        """The image (h, w, 3) with noise, grey where the camera is. `number` chooses the noise: the same one, the
        same."""
        start = int(np.random.Philox(key=self._seed, counter=number).random_raw() % NOISE_OFFSETS)
        part = slice(start, start + self._shape[0] * self._shape[1] * 3)
        noisy = cv2.add(image, self._above[part].reshape(self._shape))
        noisy = cv2.subtract(noisy, self._below[part].reshape(self._shape))
        return np.asarray(noisy if self._colour else cv2.cvtColor(noisy, cv2.COLOR_BGR2GRAY), np.uint8)
