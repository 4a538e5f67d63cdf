"""The end of a blade against the truth of drawn scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from devices.scenes import draw_scene, random_settings
from devices.scenes.settings import TipShape
from vision.pipeline import Eye


def errors_along(shape: TipShape, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(errors along the axis in m, the same over the claimed sigmas) of clear blades' tips at angles all round; NaN
    where one in view was missed."""
    errors, over = [], []
    for k in range(count):
        drawn = random_settings(870000 + k, view="tip", angle=2.4 * k, brightness=200.0, background="ground")
        settings = replace(drawn, tip_shape=shape)
        scene = draw_scene(settings)
        true = scene.truth.tip_point_px
        if true is None:
            continue
        tip = Eye(scene.geometry).observe(scene.frames).tip
        axis = np.array([np.cos(scene.truth.heading), np.sin(scene.truth.heading)])
        off = np.nan if tip is None else float((tip.point - true) @ axis)
        errors.append(off * settings.distance_m / (616 * settings.scale))
        over.append(np.nan if tip is None else off / tip.sigma_px)
    return np.array(errors), np.array(over)


def test_a_clear_spike_ends_to_the_centimetre_where_it_is_found_and_within_its_claim() -> None:
    errors, over = errors_along("spike", 12)
    assert len(errors) >= 10
    assert np.sort(np.abs(np.nan_to_num(errors, nan=1.0)))[-2] < 0.01, errors
    assert np.nanmedian(np.abs(over)) < 1.0 and np.sort(np.abs(np.nan_to_num(over, nan=9.0)))[-2] < 3.0, over
