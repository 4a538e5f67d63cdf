"""The specimen that an eye looks at before a flight takes it through every stage, with any rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vision.camera import Camera, LaserGrid, RigGeometry, StereoPair
from vision.pipeline import Eye
from vision.warm_up import DISTANCE_M, specimen, warm_up


def rig(width: int, height: int, baseline_m: float, distortion: tuple[float, float, float, float]) -> RigGeometry:
    camera = Camera(width, height, 1.006 * width, 1.006 * width, width / 2, height / 2, distortion)
    laser = LaserGrid(position=np.array([0.0, baseline_m / 2, 0.06]))
    return RigGeometry(StereoPair(camera, camera, np.eye(3), np.array([0.0, -baseline_m, 0.0])), laser)


@pytest.mark.parametrize(
    "geometry",
    [
        rig(612, 512, 0.2, (0.0, 0.0, 0.0, 0.0)),
        rig(1224, 1024, 0.05, (-0.05, 0.01, 0.0, 0.0)),
        rig(1226, 1022, 0.3, (0.0, 0.0, 0.001, 0.001)),
    ],
)
def test_an_eye_sees_distance_edges_and_tip_of_the_specimen(geometry: RigGeometry) -> None:
    seen = warm_up(Eye(geometry))
    assert seen.valid and seen.distance_m == pytest.approx(DISTANCE_M, rel=0.01)
    assert len(seen.edges) == 2 and seen.tip is not None and seen.chord_m is not None


def test_raw_mosaics_are_drawn_for_a_rig_that_delivers_them() -> None:
    geometry = replace(rig(2448, 2048, 0.2, (0.0, 0.0, 0.0, 0.0)), bayer="gbrg")
    frames = specimen(geometry, 4)
    assert frames.left_laser is not None and frames.left_laser.shape == (2048, 2448)
    seen = warm_up(Eye(geometry))
    assert len(seen.edges) == 2 and seen.distance_m == pytest.approx(DISTANCE_M, rel=0.01)


def test_an_eye_without_a_laser_says_so() -> None:
    geometry = rig(612, 512, 0.2, (0.0, 0.0, 0.0, 0.0))
    seen = warm_up(Eye(RigGeometry(geometry.stereo)))
    assert not seen.valid and "no laser" in seen.reasons[0]
