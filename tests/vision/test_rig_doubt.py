"""A rig file that does not belong to the images is told, and what calibration leaves open is forgiven."""

from dataclasses import replace

import numpy as np
import pytest

from devices.scenes import Scene, SceneSettings, draw_scene
from vision.camera import RigGeometry
from vision.capture import StereoFrames, rotation_of
from vision.pipeline import Eye


@pytest.fixture(scope="module")
def scene() -> Scene:
    return draw_scene(SceneSettings(seed=3, chord_m=1.2, tilt=(0.1, -0.1), baseline_m=0.16, background="clutter"))


def with_baseline(rig: RigGeometry, factor: float) -> RigGeometry:
    return replace(rig, stereo=replace(rig.stereo, translation=rig.stereo.translation * factor))


@pytest.mark.parametrize("factor", [0.2, 0.5, 0.8, 0.88, 1.15, 1.3, 1.6, 2.0, 4.0])
def test_a_rig_file_of_another_baseline_makes_no_distance_wrong_without_a_word(scene: Scene, factor: float) -> None:
    """Some dots can be read so that they fit: then the laser has set them right."""
    observation = Eye(with_baseline(scene.geometry, factor)).observe(scene.frames)
    if observation.valid:
        assert factor >= 2
        assert observation.distance_m == pytest.approx(scene.truth.distance_m, rel=0.05)
    else:
        assert observation.reasons
        assert observation.distance_m is None


def test_a_rig_whose_cameras_are_swapped_is_refused(scene: Scene) -> None:
    shot = scene.frames
    swapped = StereoFrames(0.0, shot.right, shot.left, shot.right_laser, shot.left_laser)
    assert not Eye(scene.geometry).observe(swapped).valid


def test_a_laser_of_another_fan_is_refused(scene: Scene) -> None:
    laser = scene.geometry.laser
    assert laser is not None
    other = replace(scene.geometry, laser=replace(laser, fan=(1.15 * laser.fan[0], 1.15 * laser.fan[1])))
    assert not Eye(other).observe(scene.frames).valid


def test_what_calibration_leaves_open_of_the_laser_is_forgiven(scene: Scene) -> None:
    laser = scene.geometry.laser
    assert laser is not None
    moved = laser.position + np.array([0.004, -0.003, 0.003])
    turned = laser.rotation @ rotation_of(0.002, 0.0008, -0.0008)
    observation = Eye(replace(scene.geometry, laser=replace(laser, position=moved, rotation=turned))).observe(
        scene.frames
    )
    assert observation.valid, observation.reasons
    assert observation.distance_m == pytest.approx(scene.truth.distance_m, rel=0.01)


def test_a_laser_beside_the_left_lens_says_nothing_of_the_distance_and_refuses_nothing() -> None:
    beside = draw_scene(SceneSettings(seed=4, chord_m=1.2, laser_position_m=(0.0, 0.002, 0.0)))
    assert Eye(beside.geometry).observe(beside.frames).valid
