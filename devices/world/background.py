"""What lies behind the turbine: sky with clouds, haze at the horizon, and the ground far below."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.world.settings import Light
from vision.compiled import compiled

TILE = 1024  # texels of a ground and a cloud tile, a power of two
TEXEL_M = 1.0
HAZE = np.array([222.0, 214.0, 205.0])  # BGR at the horizon
ZENITH = np.array([205.0, 152.0, 104.0])
CLOUD = np.array([238.0, 236.0, 232.0])


@dataclass(frozen=True)
class Surroundings:
    """ground (TILE, TILE, 3) BGR and clouds (TILE, TILE) 0 to 255, both seamless."""

    ground: NDArray[np.uint8]
    clouds: NDArray[np.uint8]


def _seamless(random: np.random.Generator, beta: float) -> NDArray[np.float64]:
    """Fractal noise (TILE, TILE) of zero mean and unit deviation that repeats without a seam; beta: fall of its
    spectrum."""
    frequency = np.hypot(np.fft.fftfreq(TILE)[:, None], np.fft.rfftfreq(TILE)[None, :])
    frequency[0, 0] = np.inf
    noise = np.fft.rfft2(random.standard_normal((TILE, TILE))) * frequency ** (-beta / 2)
    field = np.fft.irfft2(noise, (TILE, TILE))
    result: NDArray[np.float64] = field / field.std()
    return result


@lru_cache(maxsize=4)
def surroundings(light: Light, seed: int) -> Surroundings:
    """The tiles of a world: fields with hedges and tracks, sea with waves, or plain grey."""
    random = np.random.default_rng([seed, 2])
    cover = 1 / (1 + np.exp(-3.0 * (_seamless(random, 3.0) - 1.2 + 2.4 * light.clouds)))
    clouds = np.asarray(cover * 255 * (light.clouds > 0), np.uint8)
    fine = _seamless(random, 1.2)[..., None]
    if light.background == "plain":
        ground = np.full((TILE, TILE, 3), 110.0)
    elif light.background == "sea":
        ground = np.array([112.0, 92.0, 64.0]) + 9 * fine * np.array([1.0, 0.95, 0.8])
    else:
        ground = _fields(random) + 6 * fine
    return Surroundings(np.asarray(np.clip(ground, 0, 255), np.uint8), clouds)


def _fields(random: np.random.Generator) -> NDArray[np.float64]:
    """Strips of farmland (TILE, TILE, 3) with hedges between and tracks across."""
    palette = np.array(
        [(62, 112, 96), (70, 130, 120), (80, 140, 158), (58, 96, 72), (88, 118, 140), (64, 104, 108)], float
    )
    ground = np.empty((TILE, TILE, 3))
    top = 0
    while top < TILE:
        bottom = min(top + int(random.integers(60, 160)), TILE)
        left = 0
        while left < TILE:
            right = min(left + int(random.integers(70, 260)), TILE)
            colour = palette[random.integers(len(palette))] * random.uniform(0.85, 1.1)
            rows = np.sin(np.arange(right - left) * random.uniform(0.3, 0.9)) * 4
            ground[top:bottom, left:right] = colour + rows[None, :, None]
            ground[top:bottom, left : left + 3] = (44, 66, 50)
            left = right
        ground[top : top + (4 if random.random() < 0.6 else 6)] = (
            (44, 66, 50) if random.random() < 0.6 else (120, 140, 150)
        )
        top = bottom
    return np.asarray(cv2.GaussianBlur(ground, (0, 0), 0.8), np.float64)


@compiled
def _draw(
    image: Any, rotation: Any, position: Any, lens: Any, exposure: float, height: float, tiles: Any, seen: Any
) -> None:
    ground, clouds, haze, zenith, white = tiles
    rows, columns = image.shape[:2]
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    mask = TILE - 1
    step = max(seen.shape[0] // (2 * rows - 1), 1)
    last_row, last_column = seen.shape[0] - 1, seen.shape[1] - 1
    for v in range(rows):
        rz = (v - cy) / fy
        above, below = max((2 * v - 1) * step, 0), min((2 * v + 3) * step - 1, last_row)
        for u in range(columns):
            left, right = max((2 * u - 1) * step, 0), min((2 * u + 3) * step - 1, last_column)
            if (
                seen[above, left] >= 0
                and seen[above, right] >= 0
                and seen[below, left] >= 0
                and seen[below, right] >= 0
            ):
                for c in range(3):
                    image[v, u, c] = 128
                continue
            ry = (u - cx) / fx
            north = rotation[0, 0] + rotation[0, 1] * ry + rotation[0, 2] * rz
            east = rotation[1, 0] + rotation[1, 1] * ry + rotation[1, 2] * rz
            down = rotation[2, 0] + rotation[2, 1] * ry + rotation[2, 2] * rz
            down = down / np.sqrt(1.0 + ry * ry + rz * rz)
            if down < 0.0:
                scale = 160.0 / (0.10 - down)
                x, y = north * scale + 64 * TILE, east * scale + 64 * TILE
                i, j = int(x), int(y)
                a, b = x - i, y - j
                i, j = i & mask, j & mask
                k, m = (i + 1) & mask, (j + 1) & mask
                cover = (1 - a) * ((1 - b) * clouds[i, j] + b * clouds[i, m]) + a * (
                    (1 - b) * clouds[k, j] + b * clouds[k, m]
                )
                rise = min(-down * 2.2, 1.0)
                share = cover * (1.0 / 255.0) * min(-down * 6.0, 1.0) * 0.85
                for c in range(3):
                    value = haze[c] + (zenith[c] - haze[c]) * rise
                    value = value + (white[c] - value) * share
                    image[v, u, c] = min(int(value * exposure + 0.5), 255)
            else:
                distance = height / max(down, 1e-4)
                fade = min(distance / 2500.0, 1.0)
                x = (position[0] + north * distance) / TEXEL_M
                y = (position[1] + east * distance) / TEXEL_M
                clear = (1 - fade) ** 2
                if clear <= 0.0:
                    for c in range(3):
                        image[v, u, c] = min(int(haze[c] * exposure + 0.5), 255)
                    continue
                x, y = x + 64 * TILE, y + 64 * TILE
                i, j = int(x), int(y)
                a, b = x - i, y - j
                i, j = i & mask, j & mask
                k, m = (i + 1) & mask, (j + 1) & mask
                for c in range(3):
                    value = (1 - a) * ((1 - b) * ground[i, j, c] + b * ground[i, m, c])
                    value += a * ((1 - b) * ground[k, j, c] + b * ground[k, m, c])
                    value = haze[c] + (value - haze[c]) * clear
                    image[v, u, c] = min(int(value * exposure + 0.5), 255)


def background(
    tiles: Surroundings,
    size: tuple[int, int],
    lens: NDArray[np.float64],
    rotation: NDArray[np.float64],
    position: NDArray[np.float64],
    ground_down_m: float,
    exposure: float,
    seen: NDArray[np.int32],
) -> NDArray[np.uint8]:
    """An image (height, width, 3) BGR of size (width, height) seen from a pose in local NED, the ground at
    `ground_down_m`.

    Drawn at half the resolution, for what is far is out of focus. lens: fx, fy, cx, cy. seen:
    of `raster.visibility`; what the turbine hides is left grey.
    """
    width, height = size
    half = np.empty(((height + 1) // 2, (width + 1) // 2, 3), np.uint8)
    coarse = np.array([lens[0] / 2, lens[1] / 2, (lens[2] + 0.5) / 2 - 0.5, (lens[3] + 0.5) / 2 - 0.5])
    above = max(float(ground_down_m - position[2]), 0.5)
    _draw(half, rotation, position, coarse, exposure, above, (tiles.ground, tiles.clouds, HAZE, ZENITH, CLOUD), seen)
    full = cv2.resize(half, (half.shape[1] * 2, half.shape[0] * 2), interpolation=cv2.INTER_LINEAR)
    image: NDArray[np.uint8] = np.ascontiguousarray(full[:height, :width], np.uint8)
    return image
