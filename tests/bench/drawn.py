"""The scenes that the eye is measured on: reproducible, evenly over angles, and observed on every core."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor

import cv2
import numpy as np

from devices.scenes import draw_scene, random_settings
from devices.scenes.settings import VIEWS, SceneSettings
from tests.bench.judge import Verdict, judge
from vision.pipeline import Eye

BIN_DEG = 15
BASELINES_M = (0.05, 0.10, 0.20, 0.30)
GOLDEN_DEG = 137.50776  # turns that never repeat, however many are drawn


def settings_of(count: int, first_seed: int, motion: bool = False) -> Iterable[SceneSettings]:
    """Scenes of every view at angles spread evenly over the circle."""
    for k in range(count):
        angle = float(np.deg2rad((k * GOLDEN_DEG) % 360))
        yield random_settings(first_seed + k, view=VIEWS[k % len(VIEWS)], angle=angle, motion=motion)


def in_bins(per_bin: int, first_seed: int) -> Iterable[SceneSettings]:
    """Scenes with both edges in view, as many in each bin of the blade's direction."""
    rng = np.random.default_rng(first_seed)
    for k in range(per_bin * 360 // BIN_DEG):
        angle = float(np.deg2rad((k % (360 // BIN_DEG) + rng.uniform()) * BIN_DEG))
        yield random_settings(first_seed + k, view="two_edges", angle=angle)


def at_three_metres(per_baseline: int, first_seed: int) -> Iterable[SceneSettings]:
    """Scenes with both edges in view from 3 m, as many with each baseline."""
    for k in range(per_baseline * len(BASELINES_M)):
        angle = float(np.deg2rad((k * GOLDEN_DEG) % 360))
        baseline = BASELINES_M[k % len(BASELINES_M)]
        yield random_settings(first_seed + k, view="two_edges", angle=angle, distance_m=3.0, baseline_m=baseline)


def measure(
    scenes: Iterable[SceneSettings], told: Callable[[str], None] = lambda line: None, jobs: int = 1
) -> list[Verdict]:
    """Draw, observe and judge scenes; what goes wrong is told. The order is that of the scenes, whatever the jobs."""
    wanted = list(scenes)
    verdicts = []
    with ProcessPoolExecutor(jobs) as pool:
        for settings, verdict in zip(wanted, pool.map(observed, wanted, chunksize=4), strict=True):
            verdicts.append(verdict)
            if verdict.unsaid or not verdict.edges_right:
                told(
                    f"  seed {settings.seed} {settings.view} {settings.background}: edges {verdict.edge_errors}, "
                    f"{verdict.edges_due} due, depth {verdict.depth_error}"
                )
    return verdicts


def observed(settings: SceneSettings) -> Verdict:
    """One scene, drawn, observed on one thread, and judged."""
    cv2.setNumThreads(1)
    scene = draw_scene(settings)
    return judge(scene, Eye(scene.geometry).observe(scene.frames))
