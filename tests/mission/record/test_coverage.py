"""Coverage: which stretch of the edge a frame shows, and what share of the span the frames show together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mission.record.coverage import mm_per_px, share, visible_stretch
from tests.mission.record.synthetic_run import CAMERA, estimate
from vision.observation import Line

metres = st.floats(0.0, 45.0)


@given(st.lists(st.tuples(metres, metres).map(sorted), max_size=12))
def test_the_share_is_that_of_a_fine_ruler(stretches: list[list[float]]) -> None:
    ruler = np.linspace(1.0, 40.0, 7801)
    seen = np.zeros(len(ruler), bool)
    for low, high in stretches:
        seen |= (ruler >= low) & (ruler <= high)
    assert abs(share([(low, high) for low, high in stretches], 1.0, 40.0) - seen.mean()) < 0.004


def test_nothing_seen_is_nothing_covered_and_everything_is_one() -> None:
    assert share([], 1.0, 40.0) == 0.0
    assert share([(0.0, 50.0), (3.0, 4.0)], 1.0, 40.0) == 1.0


def test_a_pixel_at_three_metres_spans_what_the_lens_says() -> None:
    assert abs(mm_per_px(3.08, 616.0) - 5.0) < 1e-9


@given(st.floats(0, 2 * np.pi), st.floats(-200, 200), st.floats(2.0, 6.0))
def test_the_visible_stretch_is_what_the_camera_sees_of_a_line_in_space(
    heading: float, offset_px: float, distance_m: float
) -> None:
    """Points along an edge, placed in space before the camera and projected: the outermost that lie in the image."""
    along = np.array([np.cos(heading), np.sin(heading)])
    normal = np.array([-along[1], along[0]]) * (1.0 if offset_px >= 0 else -1.0)
    line = Line(float(np.arctan2(normal[1], normal[0])), abs(offset_px))
    base = estimate(0.0, 20.0, distance_m)
    assert base.leading is not None
    seen = visible_stretch(replace(base, heading=heading, leading=replace(base.leading, line=line)), "leading", CAMERA)
    stations = np.linspace(10.0, 30.0, 8001)
    yz = (abs(offset_px) * distance_m / CAMERA.fx) * normal + np.outer(stations - 20.0, along)
    pixels = CAMERA.project(np.column_stack([np.full(len(yz), distance_m), yz]))
    inside = (np.abs(pixels - CAMERA.centre) <= (np.array([CAMERA.width, CAMERA.height]) - 1) / 2).all(axis=1)
    assert seen is not None
    assert abs(seen[0] - stations[inside].min()) < 0.01
    assert abs(seen[1] - stations[inside].max()) < 0.01


def test_truth_and_belief_call_the_same_frames_sharp() -> None:
    from devices.world import truth
    from mission.record import coverage

    assert truth.SHARP == coverage.SHARP


def test_an_edge_outside_the_image_covers_nothing() -> None:
    base = estimate(0.0, 20.0, 3.0)
    assert base.leading is not None
    outside = replace(base, leading=replace(base.leading, line=Line(0.0, 400.0)))
    assert visible_stretch(outside, "leading", CAMERA) is None
    assert visible_stretch(replace(base, trailing=None), "trailing", CAMERA) is None
