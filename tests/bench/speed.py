"""Speed of the eye per stage on one thread, beside the floor of the same run: halving the four full images twice."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from devices.scenes import Scene, draw_scene, random_settings
from vision.capture import Image
from vision.pipeline import Eye

STAGES = ("reduce", "dots", "match", "surface", "edges", "tip", "rest", "total")
ASKED_MS, ASKED_FLOORS, ASKED_BAYER_FLOORS = 8.0, 2.2, 1.1


@dataclass(frozen=True)
class Speed:
    """Median milliseconds per stage of one kind of frames, and of the floor of full images, None for small ones."""

    name: str
    stages: dict[str, float]
    floor_ms: float | None
    asked: float  # ms, or times the floor where there is one


def measure(now: Callable[[], float], scenes: int = 12, repeats: int = 5) -> list[Speed]:
    """Seconds by `now`: process_time is what the eye itself costs, also on a busy machine, perf_counter what it
    takes."""
    cv2.setNumThreads(1)
    small = [
        _of(f"612 × 512 {name}", now, (_scene(seed, colour, 1) for seed in range(scenes)), repeats, ASKED_MS)
        for name, colour in (("grey", False), ("colour", True))
    ]
    large = [_scene(seed, True, 4) for seed in range(3)]
    full = _of("2448 × 2048 colour", now, large, repeats, ASKED_FLOORS)
    return [*small, full, _of("2448 × 2048 Bayer", now, map(_raw, large), repeats, ASKED_BAYER_FLOORS)]


def table(speeds: Sequence[Speed], clock: str) -> list[str]:
    """Milliseconds per stage, and the ratio to the floor."""
    lines = [
        f"speed, median {clock} milliseconds on one thread",
        "  " + " " * 20 + "".join(f"{stage:>9}" for stage in STAGES) + f"{'floor':>9}{'ratio':>9}{'asked for':>12}",
    ]
    for speed in speeds:
        row = f"  {speed.name:<20}" + "".join(f"{speed.stages[stage]:9.2f}" for stage in STAGES)
        if speed.floor_ms is None:
            row += f"{'':>18}{f'{speed.asked:g} ms':>12}"
        else:
            row += f"{speed.floor_ms:9.2f}{speed.stages['total'] / speed.floor_ms:9.2f}{f'{speed.asked:g}':>12}"
        lines.append(row)
    return lines


def _scene(seed: int, colour: bool, scale: int) -> Scene:
    return draw_scene(random_settings(9000 + seed, colour=colour, scale=scale))


def _raw(scene: Scene) -> Scene:
    """The scene as colour cameras deliver it before anything is interpolated: one colour a pixel, red first."""
    frames = scene.frames
    left, right, left_laser, right_laser = (
        None if image is None else _mosaic(image)
        for image in (frames.left, frames.right, frames.left_laser, frames.right_laser)
    )
    raw = replace(frames, left=left, right=right, left_laser=left_laser, right_laser=right_laser)
    return replace(scene, frames=raw, geometry=replace(scene.geometry, bayer="rggb"))


def _mosaic(image: Image) -> Image:
    raw = image[..., 1].copy()
    raw[0::2, 0::2], raw[1::2, 1::2] = image[0::2, 0::2, 2], image[1::2, 1::2, 0]
    return raw


def _of(name: str, now: Callable[[], float], scenes: Iterable[Scene], repeats: int, asked: float) -> Speed:
    laps: dict[str, list[float]] = {stage: [] for stage in STAGES}
    floors: list[float] = []
    for scene in scenes:
        eye = Eye(scene.geometry, now)
        eye.observe(scene.frames)
        for _ in range(repeats):
            elapsed = eye.observe(scene.frames).elapsed_ms
            for stage in STAGES:
                laps[stage].append(elapsed.get(stage, 0.0))
            if asked < ASKED_MS:
                floors.append(_floor_ms(scene, now))
    stages = {stage: float(np.median(spent)) for stage, spent in laps.items()}
    return Speed(name, stages, float(np.median(floors)) if floors else None, asked)


def _floor_ms(scene: Scene, now: Callable[[], float]) -> float:
    """Two INTER_AREA halvings and grey of four colour images of this size."""
    frames = scene.frames
    images = [i for i in (frames.left, frames.right, frames.left_laser, frames.right_laser) if i is not None]
    images = [cv2.cvtColor(i, cv2.COLOR_GRAY2BGR) if i.ndim == 2 else i for i in images]
    started = now()
    for image in images:
        _floor(image)
    return 1e3 * (now() - started)


def _floor(image: Image) -> None:
    once = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    twice = cv2.resize(once, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    cv2.cvtColor(twice, cv2.COLOR_BGR2GRAY)
