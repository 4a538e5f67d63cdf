"""What the sensor makes of a drawn image: laser spots, vignette, noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.world.compiled import compiled

Array = NDArray[np.float64]
NOISE = 1 << 20
GREEN = (0.30, 1.0, 0.22)  # what blue, green and red pixels make of the laser's light


@compiled
def add_spots(image: Any, centres: Any, amplitude: Any, sigma: Any, streak: Any) -> None:
    """Add Gaussian spots of green light to image (h, w, 3): centres (n, 2) px, amplitude (n,) grey values, sigma (n,)
    px and streak (n,) px, by which a spot is longer to the right than high. Values saturate at 255."""
    height, width = image.shape[:2]
    for i in range(len(centres)):
        u, v, s, long = centres[i, 0], centres[i, 1], sigma[i], streak[i]
        reach = 3.5 * s
        for y in range(max(int(np.ceil(v - reach)), 0), min(int(np.floor(v + reach)), height - 1) + 1):
            begin, end = max(int(np.ceil(u - reach - long / 2)), 0), min(int(np.floor(u + reach + long / 2)), width - 1)
            for x in range(begin, end + 1):
                away = max(abs(x - u) - long / 2, 0.0)
                value = amplitude[i] * np.exp(-(away * away + (y - v) ** 2) / (2 * s * s))
                for c in range(3):
                    image[y, x, c] = min(int(image[y, x, c] + value * GREEN[c] + 0.5), 255)


def noise_tile(sigma: float, seed: int) -> NDArray[np.int8]:
    """Rounded Gaussian noise, drawn once and laid over every image at another offset."""
    random = np.random.default_rng([seed, 3])
    return np.asarray(np.clip(np.round(random.normal(0, sigma, NOISE)), -127, 127), np.int8)


@compiled
def _mixed(x: int) -> int:
    """A well-mixed 20-bit number of x: splitmix64."""
    z = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return int((z ^ (z >> np.uint64(31))) & np.uint64(0x7FFFFFFF))


@compiled
def expose(image: Any, fall: Any, noise: Any, frame: int) -> None:
    """Darken by fall (h, w), 256 = not at all, and add noise in place; `frame` chooses the noise, the same one the
    same."""
    height, width, channels = image.shape
    length = width * channels
    for v in range(height):
        offset = _mixed(frame * 65536 + v) % (NOISE - length)
        for u in range(width):
            gain = fall[v, u]
            for c in range(channels):
                value = ((image[v, u, c] * gain + 128) >> 8) + noise[offset + u * channels + c]
                image[v, u, c] = min(max(value, 0), 255)


def vignette(width: int, height: int, share: float) -> NDArray[np.int32]:
    """fall (h, w) for `expose`: 256 in the middle, less by `share` in the corners, growing with the square of the
    distance."""
    v, u = np.mgrid[0:height, 0:width]
    r2 = ((u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2)
    return np.asarray(np.round(256 * (1 - share * r2)), np.int32)
