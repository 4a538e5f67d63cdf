"""Eye and tracker together along a drawn blade: innovations as large as claimed, distances that cover the truth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from devices.world.settings import WorldSettings
from devices.world.turbine import INSPECTED, TurbineShape
from devices.world.view import Renderer, draw
from vision.camera import Camera, LaserGrid, RigGeometry, StereoPair
from vision.capture import CameraPose, rotation_of
from vision.estimate import BladeFrame
from vision.pipeline import Eye
from vision.tracker import BladeTracker

CAMERA = Camera(612, 512, 616.0, 616.0, 305.5, 255.5)
GEOMETRY = RigGeometry(
    StereoPair(CAMERA, CAMERA, translation=np.array([0.0, -0.2, 0.0])),
    LaserGrid(11, 11, (np.deg2rad(28.2), np.deg2rad(28.2)), np.array([0.0, 0.1, -0.06])),
)
JITTER_M, JITTER_RAD = 0.01, 0.002


def depth_ahead(renderer: Renderer, pose: CameraPose) -> float:
    """Truth: the depth of the inspected blade along the optical axis, from the renderer's own z-buffer."""
    inverse, seen = renderer.visibility(CAMERA, pose)
    middle = slice(253, 259), slice(303, 309)
    assert (renderer.mesh.part[seen[middle]] == INSPECTED).all()
    return float(1 / np.median(inverse[middle]))


@pytest.mark.parametrize("azimuth_deg", [50.0, 180.0])
def test_a_drawn_blade_is_tracked_within_the_sigmas(azimuth_deg: float) -> None:
    shape = TurbineShape(north_m=60, east_m=10, heading_deg=8, azimuth_deg=azimuth_deg)
    renderer, eye, rng = Renderer(shape, WorldSettings(seed=3)), Eye(GEOMETRY), np.random.default_rng(3)
    true = shape.blade_frame()
    # The survey: half a metre and a degree wrong.
    turned = rotation_of(0.0, 0.005, 0.017)
    survey = BladeFrame(true.origin + np.array([0.4, -0.1, 0.2]), *(turned @ v for v in true.rotation))
    tracker = BladeTracker(survey, CAMERA)
    forward = true.depth
    updates, errors = [], []
    for k, station in enumerate(np.arange(16.0, 17.7, 0.08)):
        place = true.to_ned(np.array([station, 0.0, -3.0])) + 0.04 * np.sin(np.array([k, 1.3 * k, 0.7 * k]) / 4)
        look = rotation_of(0.0, -np.arcsin(forward[2]), np.arctan2(forward[1], forward[0]))
        pose = CameraPose(place, look, JITTER_M)
        told = CameraPose(
            place + rng.normal(0, JITTER_M, 3), look @ rotation_of(*rng.normal(0, JITTER_RAD, 3)), JITTER_M
        )
        observation = eye.observe(draw(renderer, GEOMETRY, pose, stamp_s=k * 0.1, frame=k))
        updates.append(tracker.update(observation, told))
        estimate = tracker.estimate(k * 0.1, told)
        if k > 4 and estimate is not None:
            errors.append((estimate.distance_m - depth_ahead(renderer, pose), estimate.distance_sigma_m))
    used = [update for update in updates[2:] if update.accepted]
    assert len(used) >= 0.9 * len(updates[2:])
    beyond = [update.nis > chi2.ppf(0.99, update.dof) for update in used]
    assert np.mean(beyond) < 0.1
    assert 0.35 < sum(update.nis for update in used) / sum(update.dof for update in used) < 1.5
    error, sigma = np.array(errors).T
    assert np.sqrt(np.mean(error**2)) < 0.008
    assert np.median(sigma) < 0.006
    # what is wrong with the distance hardly changes along so short a way: these are not many errors but one
    assert np.mean(np.abs(error) < 3 * sigma) > 0.9
    assert estimate.leading is not None or estimate.trailing is not None
