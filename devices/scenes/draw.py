"""Draws the four images of a close-up scene: every pixel's ray is met with the blade in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.scenes.background import Background, coverage, sample, texture
from devices.scenes.blade import BladePiece
from devices.scenes.settings import SceneSettings
from devices.scenes.truth import SceneTruth, scene_truth
from vision.camera import Camera, LaserGrid, RigGeometry, StereoPair
from vision.capture import StereoFrames

Array = NDArray[Any]  # of floats
Image = NDArray[np.uint8]


BRIGHTEST = 238.0  # of 255: an exposed blade is not burnt out, or no laser could be seen on it


@dataclass(frozen=True)
class Scene:
    """Images, the rig that took them, and the truth."""

    settings: SceneSettings
    frames: StereoFrames
    geometry: RigGeometry
    truth: SceneTruth


def scene_geometry(settings: SceneSettings) -> RigGeometry:
    """The rig of a scene: two equal cameras side by side and the laser's 11 × 11 dots over 28.2°."""
    scale = settings.scale
    width, height = 612 * scale, 512 * scale
    camera = Camera(width, height, 616.0 * scale, 616.0 * scale, (width - 1) / 2, (height - 1) / 2, settings.distortion)
    stereo = StereoPair(camera, camera, np.eye(3), np.array([0.0, -settings.baseline_m, 0.0]))
    return RigGeometry(stereo, LaserGrid(position=np.array(settings.laser_position_m)))


@lru_cache(maxsize=2)
def _directions(camera: Camera) -> tuple[Array, Array]:
    v, u = np.mgrid[: camera.height, : camera.width].astype(np.float64)
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
    shape = (camera.height, camera.width)
    return rays[:, 1].reshape(shape).astype(np.float32), rays[:, 2].reshape(shape).astype(np.float32)


def draw_scene(settings: SceneSettings) -> Scene:
    """Images and truth of one scene, the same for the same settings."""
    geometry = scene_geometry(settings)
    assert geometry.laser is not None
    blade, background = BladePiece(settings), Background(settings)
    truth = scene_truth(blade, background, geometry.stereo, geometry.laser)
    rng = np.random.default_rng([settings.seed, 13])
    dirt = texture(rng, 6, 5)
    light = rng.uniform(0, 2 * np.pi)
    images: dict[str, Image] = {}
    eyes = (("left", 0.0, truth.uv_left), ("right", settings.baseline_m, truth.uv_right))
    for name, eye_y, uv in eyes:
        clean = _draw_eye(settings, blade, background, geometry.stereo.left, eye_y, dirt, float(light))
        dots = _draw_dots(settings, geometry, clean, uv, truth, np.random.default_rng([settings.seed, 17]))
        images[f"{name}_laser"] = _expose(settings, dots, rng)
        images[name] = _expose(settings, _moved(clean, settings), rng)
    frames = StereoFrames(0.0, images["left"], images["right"], images["left_laser"], images["right_laser"])
    return Scene(settings, frames, geometry, truth)


def _draw_eye(
    settings: SceneSettings,
    blade: BladePiece,
    background: Background,
    camera: Camera,
    eye_y: float,
    dirt: Array,
    light: float,
) -> Array:
    y, z = _directions(camera)
    eye = np.array([0.0, eye_y, 0.0])
    rays = np.stack([np.ones_like(y), y, z], axis=-1)
    _, s, n = blade.meet(eye, rays)
    inside = coverage(np.nan_to_num(blade.inside(s, n), nan=-1.0).astype(np.float32))
    s, n = np.nan_to_num(s).astype(np.float32), np.nan_to_num(n).astype(np.float32)
    slope = (s * np.cos(light) + n * np.sin(light)) / settings.distance_m
    level = settings.brightness * (1 + settings.shade * np.clip(slope / 0.5, -1, 1))
    level *= 1 + 0.35 * settings.dirt * sample(dirt, s / 3, n / 3)
    if settings.glare:
        level += 255 * settings.glare * np.exp(-((slope - 0.1) ** 2) / 0.01)
    level = np.minimum(level, BRIGHTEST)
    tint = np.array([0.98, 1.0, 1.01], np.float32)
    image = background.colour(y, z, eye_y)
    image += (level[..., None] * tint - image) * inside[..., None]
    return image


def _draw_dots(
    settings: SceneSettings,
    geometry: RigGeometry,
    clean: Array,
    uv: Array | NDArray[np.float64],
    truth: SceneTruth,
    rng: np.random.Generator,
) -> Array:
    image = clean.copy()
    height, width = image.shape[:2]
    strength = rng.uniform(0.75, 1.1, len(uv))
    sigma = settings.dot_sigma_px * settings.scale
    way = 0.3
    reach = int(np.ceil(4 * sigma * settings.dot_streak)) + 1
    for (u, v), power, point in zip(uv, strength, truth.points, strict=True):
        if not np.isfinite(u):
            continue
        left, top = round(u) - reach, round(v) - reach
        box = (
            slice(max(top, 0), min(top + 2 * reach + 1, height)),
            slice(max(left, 0), min(left + 2 * reach + 1, width)),
        )
        dy, dx = np.mgrid[box].astype(np.float64) - np.array([v, u])[:, None, None]
        a, b = dx * np.cos(way) + dy * np.sin(way), dy * np.cos(way) - dx * np.sin(way)
        spot = np.exp(-0.5 * ((a / (sigma * settings.dot_streak)) ** 2 + (b / sigma) ** 2))
        local = float(clean[min(max(round(v), 0), height - 1), min(max(round(u), 0), width - 1)].mean()) / 255
        level = settings.dot_level * power * (0.15 + 0.85 * local) * min((settings.distance_m / point[0]) ** 2, 1.0)
        image[box] += (level * spot)[..., None].astype(np.float32) * np.array([0.12, 1.0, 0.10], np.float32)
    return image


def _moved(clean: Array, settings: SceneSettings) -> Array:
    if not any(settings.motion_px):
        return clean
    dx, dy = (value * settings.scale / 4 for value in settings.motion_px)
    shift = np.array([[1, 0, dx], [0, 1, dy]], np.float32)
    moved = cv2.warpAffine(clean, shift, clean.shape[1::-1], flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved, np.float32)


def _expose(settings: SceneSettings, light: Array, rng: np.random.Generator) -> Image:
    scale = settings.scale
    image = cv2.GaussianBlur(light, (0, 0), settings.blur_px * scale)
    if settings.motion_blur_px > 1:
        way = settings.seed % 7 / 7 * np.pi
        reach = settings.motion_blur_px * scale / 2
        size = int(np.ceil(reach)) * 2 + 3
        kernel = np.zeros((size, size), np.float32)
        for share in np.linspace(-reach, reach, 8 * size + 1):
            spot = np.eye(2, 3, dtype=np.float32)
            spot[:, 2] = share * np.cos(way), share * np.sin(way)
            dot = np.zeros((size, size), np.float32)
            dot[size // 2, size // 2] = 1
            kernel += cv2.warpAffine(dot, spot, (size, size))
        image = cv2.filter2D(image, -1, kernel / kernel.sum())
    if not settings.colour:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    noise = rng.standard_normal((256, *image.shape[1:]), np.float32) if scale > 1 else None
    if noise is None:
        image += settings.noise * rng.standard_normal(image.shape, np.float32)
    else:
        for top in range(0, image.shape[0], 256):
            part = image[top : top + 256]
            shifted = np.roll(noise, int(rng.integers(image.shape[1])), axis=1)
            part += settings.noise * shifted[: len(part)]
    return np.asarray(np.clip(np.rint(image), 0, 255), np.uint8)
