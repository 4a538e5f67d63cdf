"""Dirt, streaks and cracks: how dark each spot of the turbine's surface is, drawn once per world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.world.settings import Light, Surface
from devices.world.turbine import BLADES, HUB, INSPECTED, NACELLE, SECOND, THIRD, TOWER, TurbineShape

Grey = NDArray[np.float32]
ROWS_PER_M = 200  # 5 mm along a blade
GIRTH = 1024


@dataclass(frozen=True)
class Skins:
    """Dirt 0 to 255 of every part one behind the other, where each begins (see `raster.shade`), and the parts'
    colours."""

    dirt: NDArray[np.uint8]
    layout: NDArray[np.int64]
    tint: NDArray[np.float64]


def _cloud(random: np.random.Generator, rows: int, columns: int, cells: tuple[int, int]) -> Grey:
    """Smooth noise (rows, columns) from 0 to 1 with so many cells down and across."""
    coarse = random.random((cells[0] + 1, cells[1] + 1), dtype=np.float32)
    return np.asarray(cv2.resize(coarse, (columns, rows), interpolation=cv2.INTER_LINEAR), np.float32)


def _blade(random: np.random.Generator, length_m: float, surface: Surface) -> NDArray[np.uint8]:
    rows = int(length_m * ROWS_PER_M)
    metres = int(length_m)
    dirt = 0.10 * _cloud(random, rows, GIRTH, (metres * 3, 24))
    dirt += 0.10 * _cloud(random, rows, GIRTH, (metres * 14, 60)) * _cloud(random, rows, GIRTH, (metres, 6))
    streaks = _cloud(random, rows, GIRTH, (metres * 30, 3)) ** 6 * _cloud(random, rows, GIRTH, (metres * 2, 4))
    dirt += 0.55 * streaks
    around = np.linspace(0, 1, GIRTH, dtype=np.float32)
    erosion = np.exp(-(((around - 0.5) / 0.03) ** 2))[None, :]
    outward = np.linspace(0.1, 1, rows, dtype=np.float32)[:, None]
    pits = (_cloud(random, rows, GIRTH, (metres * 25, 200)) > 0.72).astype(np.float32)
    dirt += erosion * outward * (0.12 + 0.35 * pits)
    grease = _cloud(random, rows, GIRTH, (metres // 3, 16)) ** 3
    dirt += 0.5 * grease * np.exp(-np.arange(rows, dtype=np.float32) / (2.5 * ROWS_PER_M))[:, None]
    dirt *= surface.dirt / 0.5
    for row in np.arange(12.0, length_m, 12.0):  # joints of the shell
        cv2.line(dirt, (0, int(row * ROWS_PER_M)), (GIRTH, int(row * ROWS_PER_M)), 0.18, 2)
    for _ in range(surface.cracks):
        at = np.array([random.uniform(0.55, 0.95) * GIRTH, random.uniform(0.06, 0.97) * rows])
        steps = random.normal(0, 4, (24, 2)) + random.normal(0, 3, 2)
        path = np.round(at + np.cumsum(steps, axis=0)).astype(np.int32)
        cv2.polylines(dirt, [path], False, 0.7, int(random.integers(1, 3)))
    return np.asarray(np.clip(dirt * 255, 0, 255), np.uint8)


def _tower(random: np.random.Generator, height_m: float) -> NDArray[np.uint8]:
    rows, columns = int(height_m * 20), 512
    dirt = 0.10 * _cloud(random, rows, columns, (60, 20)) + 0.25 * _cloud(random, rows, columns, (5, 90)) ** 3
    dirt[np.arange(rows) % 60 == 0] += 0.10
    return np.asarray(np.clip(dirt * 255, 0, 255), np.uint8)


@lru_cache(maxsize=4)
def _marks(blade_m: float, tower_m: float, surface: Surface, seed: int) -> Mapping[int, tuple[NDArray[np.uint8], int]]:
    """Dirt of the parts and rows a metre. Kept, for many worlds share it."""
    random = np.random.default_rng([seed, 1])
    plain = np.asarray(90 * _cloud(random, 512, 512, (24, 24)) ** 2, np.uint8)
    return {
        INSPECTED: (_blade(random, blade_m, surface), ROWS_PER_M),
        SECOND: (_blade(random, blade_m, surface), ROWS_PER_M),
        TOWER: (_tower(random, tower_m), 20),
        NACELLE: (plain, 50),
    }


def skins(shape: TurbineShape, surface: Surface, light: Light, exposure: float, seed: int) -> Skins:
    """Dirt and colours of every part of a turbine. The same seed gives the same marks."""
    maps = _marks(shape.blade_length_m, shape.hub_height_m, surface, seed)
    layout, tint = np.zeros((7, 4), np.int64), np.zeros((7, 6))
    pieces, offset = [], 0
    for part, (dirt, rows_per_m) in maps.items():
        layout[part] = offset, dirt.shape[0], dirt.shape[1], rows_per_m
        pieces.append(dirt.ravel())
        offset += dirt.size
    layout[THIRD], layout[HUB] = layout[SECOND], layout[NACELLE]
    bright = light.blade_brightness * exposure
    for part in (TOWER, NACELLE, HUB, *BLADES):
        tint[part, :3] = np.array([1.0, 1.0, 0.985]) * bright * (1.04 if part == TOWER else 1.0)
        tint[part, 3:] = 0.92, 0.86, 0.78
    return Skins(np.concatenate(pieces), layout, tint)


def lit(normals: NDArray[np.float64], light: Light) -> NDArray[np.float64]:
    """Light (n,) from 0 to 1 on surfaces with outward normals (n, 3) in local NED: sun, sky from above, ground from
    below."""
    azimuth, elevation = np.deg2rad(light.sun_azimuth_deg), np.deg2rad(light.sun_elevation_deg)
    sun = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
    sky = 0.78 - 0.22 * normals[:, 2]
    result: NDArray[np.float64] = light.ambient * sky + (1 - light.ambient) * np.maximum(normals @ sun, 0.0)
    return result
