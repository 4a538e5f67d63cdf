"""Speed of the eye per stage on one thread, beside the floor of the same run: halving the four full images twice."""

from __future__ import annotations

import time
from collections.abc import Callable

import cv2
import numpy as np

from devices.scenes import Scene, draw_scene, random_settings
from vision.pipeline import Eye

STAGES = ("reduce", "dots", "match", "surface", "edges", "tip", "rest", "total")


def median_ms(work: Callable[[], object], repeats: int) -> float:
    """Median wall milliseconds of a piece of work, after one run to warm up."""
    work()
    spent = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        spent.append(1e3 * (time.perf_counter() - started))
    return float(np.median(spent))


def floor_ms(scene: Scene, repeats: int) -> float:
    """Two INTER_AREA halvings and grey of the four full colour images."""
    images = [
        image
        for image in (scene.frames.left, scene.frames.right, scene.frames.left_laser, scene.frames.right_laser)
        if image is not None
    ]

    def halve() -> None:
        for image in images:
            once = cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
            twice = cv2.resize(once, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
            cv2.cvtColor(twice, cv2.COLOR_BGR2GRAY)

    return median_ms(halve, repeats)


def table(scenes: int = 8, repeats: int = 5) -> list[str]:
    """Milliseconds per stage for 612 × 512 grey and colour and 2448 × 2048 colour, and the ratio to the floor."""
    cv2.setNumThreads(1)
    lines = [
        f"speed, ms, median of {scenes} scenes × {repeats}, one thread",
        "  " + " " * 22 + "".join(f"{s:>9}" for s in STAGES),
    ]
    floor = 0.0
    for name, scale, colour in (
        ("612 × 512 grey", 1, False),
        ("612 × 512 colour", 1, True),
        ("2448 × 2048 colour", 4, True),
    ):
        laps: dict[str, list[float]] = {stage: [] for stage in STAGES}
        for seed in range(scenes if scale == 1 else min(scenes, 3)):
            scene = draw_scene(random_settings(9000 + seed, colour=colour, scale=scale))
            eye = Eye(scene.geometry, time.perf_counter)
            eye.observe(scene.frames)
            for _ in range(repeats):
                elapsed = eye.observe(scene.frames).elapsed_ms
                for stage in STAGES:
                    laps[stage].append(elapsed.get(stage, 0.0))
            if scale > 1:
                floor = floor_ms(scene, repeats)
        row = {stage: float(np.median(laps[stage])) for stage in STAGES}
        lines.append(f"  {name:<22}" + "".join(f"{row[stage]:9.2f}" for stage in STAGES))
    lines.append(
        f"  floor {floor:.1f} ms; the full images take {row['total'] / floor:.2f} × the floor (asked for: 2.2)"
    )
    return lines
