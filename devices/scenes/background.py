"""What stands behind the blade, as a function of direction, so that each eye sees it from its own place."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.scenes.settings import SceneSettings

Array = NDArray[Any]  # of floats


def texture(rng: np.random.Generator, cells: int, octaves: int = 4) -> Array:
    """A tile (512, 512) of smooth noise about zero, unit amplitude, `cells` across at the coarsest octave."""
    tile = np.zeros((512, 512), np.float32)
    for octave in range(octaves):
        size = min(cells * 2**octave, 512)
        coarse = rng.uniform(-1, 1, (size, size)).astype(np.float32)
        tile += cv2.resize(coarse, (512, 512), interpolation=cv2.INTER_CUBIC) / 2**octave
    return tile


def sample(tile: Array, y: Array, z: Array) -> Array:
    """The tile at coordinates in units of the tile, about its middle."""
    size = np.float32(tile.shape[0] - 1)
    place = (y + 0.5) * size, (z + 0.5) * size
    return np.asarray(cv2.remap(tile, *place, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101))


def coverage(value: Array) -> Array:
    """Share of each pixel on the positive side of `value`, from its own gradient: an anti-aliased step on its zero."""
    down, right = np.gradient(value)
    share = np.clip(0.5 + value / np.maximum(np.hypot(down, right), 1e-9), 0, 1)
    return np.asarray(share, np.float32)


class Background:
    """Layers drawn once by chance; `colour` draws them for one eye.

    Distances of the layers in metres: the far one at infinity, a tower or another blade at `near_m`.
    """

    def __init__(self, settings: SceneSettings) -> None:
        rng = np.random.default_rng([settings.seed, 11])
        self._kind = settings.background
        self._sky = np.array([rng.uniform(150, 250), rng.uniform(140, 230), rng.uniform(110, 215)], np.float32)
        if rng.uniform() < 0.25:
            self._sky[:] = rng.uniform(200, 252)
        self._ground = np.array([rng.uniform(20, 90), rng.uniform(50, 130), rng.uniform(30, 110)], np.float32)
        self._horizon = float(rng.uniform(-0.35, 0.35))
        self._roll = float(rng.uniform(-0.15, 0.15))
        self._clouds, self._soil = texture(rng, 3), texture(rng, 24, 5)
        self._strip_angle = (
            float(rng.uniform(0, np.pi)) if self._kind == "blade" else float(rng.normal(np.pi / 2, 0.05))
        )
        self._strip_offset = float(rng.uniform(-0.4, 0.4))
        self._strip_half = float(rng.uniform(0.05, 0.2))
        self._strip_level = float(rng.uniform(70, 230))
        self.near_m = float(settings.distance_m + rng.uniform(3.0, 8.0))
        self._cables = [(rng.uniform(0, np.pi), rng.uniform(-0.5, 0.5), rng.uniform(0.001, 0.004)) for _ in range(5)]
        self._boxes = rng.uniform(-0.6, 0.6, (8, 2)), rng.uniform(0.03, 0.25, (8, 2)), rng.uniform(10, 250, (8, 3))

    def strip(self, y: Array, z: Array) -> Array:
        """Positive on the tower or the other blade, in units of the image plane at 1 m."""
        across = -np.sin(self._strip_angle) * y + np.cos(self._strip_angle) * z
        return np.asarray(self._strip_half - np.abs(across - self._strip_offset), np.float32)

    @property
    def has_strip(self) -> bool:
        return self._kind in ("tower", "blade")

    def colour(self, y: Array, z: Array, eye_y: float) -> Array:
        """Colours (h, w, 3) BGR, 0 to 255, seen along directions (1, y, z) from an eye `eye_y` metres to the right."""
        level = z * np.float32(np.cos(self._roll)) + y * np.float32(np.sin(self._roll))
        sky = self._sky + (20 * sample(self._clouds, y / 2, z / 2) - 30 * z)[..., None] * np.array(
            [0.6, 0.8, 1.0], np.float32
        )
        if self._kind == "sky":
            image = sky
        else:
            far = y + np.float32(eye_y / 40)
            ground = self._ground * (1 + 0.35 * sample(self._soil, far / 2, z / 2))[..., None]
            share = np.ones_like(y) if self._kind == "ground" else coverage(level - np.float32(self._horizon))
            image = sky + (ground - sky) * share[..., None]
        if self._kind == "clutter":
            image = self._clutter(image, y + np.float32(eye_y / 12), z)
        if self.has_strip:
            near = y + np.float32(eye_y / self.near_m)
            value = self.strip(near, z)
            shading = self._strip_level * (0.75 + 0.25 * np.clip(value / self._strip_half, 0, 1))
            image = image + (shading[..., None] - image) * coverage(value)[..., None]
        return np.asarray(image, np.float32)

    def _clutter(self, image: Array, y: Array, z: Array) -> Array:
        for centre, size, colour in zip(*self._boxes, strict=True):
            value = np.minimum(size[0] - np.abs(y - np.float32(centre[0])), size[1] - np.abs(z - np.float32(centre[1])))
            image = image + (np.float32(colour) - image) * coverage(np.asarray(value, np.float32))[..., None]
        for angle, offset, half in self._cables:
            value = half - np.abs(-np.sin(angle) * y + np.cos(angle) * z - offset)
            image = image + (np.float32(25) - image) * coverage(np.asarray(value, np.float32))[..., None]
        return image
