"""Hub and rotor from pictures of several places, against rays and directions drawn from a true turbine."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from vision.camera import Camera
from vision.capture import CameraPose, rotation_of
from vision.observation import FarView
from vision.triangulation import ATTITUDE_SIGMA, RotorBelief, locate_hub, locate_rotor

CAMERA = Camera(612, 512, 616.0, 616.0, 305.5, 255.5)
HUB = np.array([55.8, 9.4, -78.0])


def poses(heading: float, steps: tuple[float, ...] = (-12.0, 0.0, 12.0), distance: float = 45.0) -> list[CameraPose]:
    """Places before the hub, each looking level about at it."""
    x, y, _ = rotation_of(0, 0, heading).T
    places = [HUB - distance * x + step * y for step in steps]
    return [CameraPose(p, rotation_of(0, 0.02, np.arctan2(*(HUB - p)[1::-1]) + 0.03), 0.05) for p in places]


def bearing(pose: CameraPose, point: np.ndarray) -> np.ndarray:
    """An image point by the definition of the pinhole alone."""
    x, y, z = pose.rotation.T @ (point - pose.position)
    return 616.0 * np.array([y, z]) / x


def view(pose: CameraPose, heading: float, azimuth: float, rng=None, tilt=0.0873, cone=0.035) -> FarView:
    """The rotor by the conventions: azimuth clockwise from up, nose up by the tilt, blades forward by the cone."""
    nose = rotation_of(0, -tilt, heading)
    directions = []
    for k in range(3):
        a = azimuth + k * 2 * np.pi / 3
        out = nose @ np.array([-np.sin(cone), np.cos(cone) * np.sin(a), -np.cos(cone) * np.cos(a)])
        step = bearing(pose, HUB + 10 * out) - bearing(pose, HUB)
        directions.append(np.arctan2(step[1], step[0]))
    hub, directions = bearing(pose, HUB), np.array(directions)
    if rng is not None:
        hub, directions = hub + rng.normal(0, 1.5, 2), directions + rng.normal(0, 0.008, 3)
    return FarView(True, (), hub, 1.5, np.sort(directions % (2 * np.pi)), np.full(3, 0.008))


def test_rays_meet_at_the_hub() -> None:
    fix = locate_hub([(pose, bearing(pose, HUB)) for pose in poses(0.14)], CAMERA)
    assert fix.valid
    assert np.allclose(fix.position, HUB, atol=1e-4)
    assert fix.residual_px < 1e-3


def test_covariance_covers_the_error_and_is_longest_along_the_sight() -> None:
    rng = np.random.default_rng(3)
    normalised = []
    for _ in range(60):
        prior = HUB + rng.normal(0, 2.0, 3)
        seen = []
        for pose in poses(0.14):
            turned = CameraPose(pose.position, pose.rotation @ rotation_of(0, *rng.normal(0, ATTITUDE_SIGMA, 2)), 0.05)
            seen.append((pose, bearing(turned, HUB) + rng.normal(0, 1.5, 2)))
        fix = locate_hub(seen, CAMERA, sigma_px=1.5, prior=(prior, 2.0))
        error = fix.position - HUB
        normalised.append(error @ np.linalg.solve(fix.covariance, error))
        values, vectors = np.linalg.eigh(fix.covariance)
        assert abs(vectors[:, 2] @ rotation_of(0, 0, 0.14)[:, 0]) > 0.95
        assert np.sqrt(values[2]) < 1.5
    assert 1.5 < np.mean(normalised) < 4.0  # 3 degrees of freedom; outliers are left out


def test_one_wrong_picture_among_many_is_left_out() -> None:
    seen = [(pose, bearing(pose, HUB)) for pose in poses(0.14, (-12.0, -6.0, 0.0, 6.0, 12.0))]
    seen[1] = (seen[1][0], seen[1][1] + np.array([120.0, -60.0]))
    fix = locate_hub(seen, CAMERA, prior=(HUB + 1.0, 2.0))
    assert not fix.used[1] and fix.used.sum() == 4
    assert np.linalg.norm(fix.position - HUB) < 0.3


def test_one_place_alone_leaves_the_distance_to_the_survey() -> None:
    pose = poses(0.0)[1]
    survey = HUB + np.array([1.5, 1.0, -1.0])
    fix = locate_hub([(pose, bearing(pose, HUB))], CAMERA, prior=(survey, 2.0))
    assert np.linalg.norm(fix.position[1:] - HUB[1:]) < 0.2
    assert abs(fix.position[0] - survey[0]) < 0.3
    assert 1.5 < np.sqrt(fix.covariance[0, 0]) < 2.1


def test_too_few_bearings_and_a_hub_far_from_the_survey_are_refused() -> None:
    pose = poses(0.0)[0]
    assert "too few" in locate_hub([(pose, bearing(pose, HUB))], CAMERA).reasons[0]
    seen = [(pose, bearing(pose, HUB)) for pose in poses(0.0, tuple(np.linspace(-20, 20, 9)))]
    fix = locate_hub(seen, CAMERA, sigma_px=0.1, prior=(HUB + np.array([0, 9.0, 0]), 1.0))
    assert not fix.valid
    assert "surveyed" in fix.reasons[-1]


@given(
    heading=st.floats(-3.1, 3.1),
    azimuth=st.floats(0, 2.09),
    heading_error=st.floats(-0.08, 0.08),
    distance=st.floats(30, 80),
)
@settings(max_examples=25, deadline=None, derandomize=True, phases=[Phase.generate])
def test_exact_views_give_back_hub_and_azimuth_at_any_heading(
    heading: float, azimuth: float, heading_error: float, distance: float
) -> None:
    belief = RotorBelief(HUB + np.array([1.0, -1.0, 0.5]), 2.0, heading + heading_error, np.deg2rad(5))
    places = poses(heading, (-0.3 * distance, 0.3 * distance), distance) + poses(heading, (0.0,), 0.5 * distance)
    fix = locate_rotor([(p, view(p, heading, azimuth)) for p in places], CAMERA, belief)
    assert fix.valid, fix.reasons
    assert np.linalg.norm(fix.hub.position - HUB) < 0.5
    assert abs(np.sin(fix.azimuth_near(azimuth) - azimuth)) < np.deg2rad(0.6)
    assert np.allclose(np.diff(fix.azimuths), 2 * np.pi / 3)
    assert abs(np.sin(fix.heading - heading)) < max(abs(heading_error), 0.01)


@pytest.mark.parametrize("error_deg", [-2.0, -1.0, 1.0, 2.0])
def test_a_compass_that_errs_does_not_shift_the_hub_when_near_and_far_pictures_are_taken(error_deg: float) -> None:
    rng = np.random.default_rng(4)
    misses, errors = [], []
    for _ in range(10):
        belief = RotorBelief(HUB + rng.normal(0, 1.0, 3), 2.0, 0.14 + rng.normal(0, 0.05), np.deg2rad(5))
        true = poses(0.14, (-12.0, 12.0), 48.0) * 3 + poses(0.14, (0.0,), 30.0) * 3
        seen = [(pose, view(pose, 0.14, 0.8, rng)) for pose in true]
        told = [
            (CameraPose(p.position, rotation_of(0, 0, np.deg2rad(error_deg)) @ p.rotation, 0.05), v) for p, v in seen
        ]
        fix = locate_rotor(told, CAMERA, belief)
        misses.append(np.linalg.norm((fix.hub.position - HUB)[1:]))
        errors.append(np.degrees(fix.compass_error) - error_deg)
    assert np.median(misses) < 0.4 * 48.0 * np.sin(np.deg2rad(abs(error_deg))) + 0.1
    assert np.median(np.abs(errors)) < 0.4 * abs(error_deg) + 0.1


def test_azimuth_keeps_within_its_sigma_with_noisy_views_and_a_wrong_heading() -> None:
    rng = np.random.default_rng(8)
    off = []
    for _ in range(25):
        azimuth, heading = rng.uniform(0, 2 * np.pi), 0.14
        belief = RotorBelief(HUB + rng.normal(0, 1.5, 3), 2.0, heading + rng.normal(0, 0.05), np.deg2rad(5))
        views = [(p, view(p, heading, azimuth, rng)) for p in poses(heading)]
        fix = locate_rotor(views, CAMERA, belief)
        assert fix.valid
        off.append(np.sin(fix.azimuth_near(azimuth) - azimuth) / fix.azimuth_sigma)
        assert fix.azimuth_sigma < np.deg2rad(0.8)
    assert 0.5 < np.sqrt(np.mean(np.square(off))) < 1.5


def test_views_that_show_no_rotor_are_said_to() -> None:
    belief = RotorBelief(HUB, 2.0, 0.0, 0.1)
    fix = locate_rotor([(poses(0.0)[0], FarView(False, ("fog",)))], CAMERA, belief)
    assert not fix.valid
    assert fix.reasons == ("no picture shows the rotor",)


def test_the_blade_nearest_to_the_expected_azimuth_is_named() -> None:
    pose = poses(0.0)
    fix = locate_rotor([(p, view(p, 0.0, 0.2)) for p in pose], CAMERA, RotorBelief(HUB, 2.0, 0.0, 0.05))
    for k in range(3):
        expected = 0.25 + k * 2 * np.pi / 3
        assert fix.azimuth_near(expected) == pytest.approx(expected - 0.05, abs=0.01)
