"""The whole eye on close-up scenes whose truth is known from their geometry."""

from dataclasses import replace

import numpy as np
import pytest

from devices.scenes import Scene, SceneSettings, draw_scene
from devices.scenes.settings import Behind
from vision.dots import find_spots
from vision.observation import BladeObservation, Dots
from vision.pipeline import Eye
from vision.reduction import green

ANGLES_DEG = [0, 23, 45, 67, 90, 113, 135, 158, 180, 225, 270, 315]
PLAIN = SceneSettings(
    seed=5,
    distance_m=3.0,
    chord_m=0.9,
    tilt=(0.1, -0.15),
    background="horizon",
    brightness=140.0,
    taper=(0.01, -0.005),
    dirt=0.2,
)


def seen(settings: SceneSettings) -> tuple[Scene, BladeObservation]:
    scene = draw_scene(settings)
    return scene, Eye(scene.geometry).observe(scene.frames)


def index_errors(found: Dots, true: Dots) -> tuple[int, int, float]:
    """(right, wrong, RMS distance of the right ones in px): a dot is right where its row and column truly are."""
    places = {(int(r), int(c)): uv for uv, r, c in zip(true.uv, true.row, true.column, strict=True)}
    away = [
        np.hypot(*(uv - places[r, c])) if (r, c) in places else np.inf
        for uv, r, c in zip(found.uv, found.row.tolist(), found.column.tolist(), strict=True)
    ]
    right = np.array([a for a in away if a < 2.0])
    return len(right), len(away) - len(right), float(np.sqrt(np.mean(right**2))) if len(right) else 0.0


def assert_edges(scene: Scene, observation: BladeObservation, degrees: float = 1.0, px: float = 2.0) -> None:
    assert len(observation.edges) == len(scene.truth.edges), observation.reasons
    for true in scene.truth.edges:
        edge = max(observation.edges, key=lambda edge: float(edge.outward @ true.outward))
        turned = np.arccos(np.clip(float(edge.outward @ true.outward), -1, 1))
        assert np.rad2deg(turned) < degrees
        normal = np.array([np.cos(edge.line.theta), np.sin(edge.line.theta)])
        true_normal = np.array([np.cos(true.line.theta), np.sin(true.line.theta)])
        assert edge.line.rho * float(normal @ edge.outward) == pytest.approx(
            true.line.rho * float(true_normal @ true.outward), abs=px
        )


@pytest.mark.parametrize("angle_deg", ANGLES_DEG)
def test_both_edges_heading_and_distance_are_right_at_any_angle(angle_deg: float) -> None:
    scene, observation = seen(replace(PLAIN, angle=np.deg2rad(angle_deg), seed=100 + angle_deg))
    assert observation.valid
    assert_edges(scene, observation)
    assert observation.heading is not None and observation.distance_m is not None
    turned = np.angle(np.exp(2j * (observation.heading - scene.truth.heading))) / 2
    assert abs(np.rad2deg(turned)) < 2
    assert observation.distance_m == pytest.approx(scene.truth.distance_m, rel=0.01)
    assert observation.chord_m == pytest.approx(scene.truth.chord_m, rel=0.03)
    assert observation.tip is None


@pytest.mark.parametrize("baseline_m", [0.05, 0.12, 0.20, 0.30])
@pytest.mark.parametrize("distance_m", [1.6, 3.0, 5.8])
def test_no_match_is_wrong_at_any_baseline_and_distance(baseline_m: float, distance_m: float) -> None:
    settings = replace(PLAIN, baseline_m=baseline_m, distance_m=distance_m, chord_m=0.3 * distance_m, angle=1.0)
    scene, observation = seen(settings)
    assert observation.valid and observation.dots_left is not None and observation.dots_right is not None
    for found, side in ((observation.dots_left, "left"), (observation.dots_right, "right")):
        right, wrong, rms = index_errors(found, scene.truth.dots(side))
        assert wrong == 0
        assert right >= 0.95 * len(scene.truth.dots(side))
        assert rms < 0.25
    nearest = np.linalg.norm(scene.truth.points[scene.truth.on_blade], axis=1).min()
    assert observation.nearest_m == pytest.approx(nearest, rel=0.005)


@pytest.mark.parametrize("brightness", [25.0, 60.0, 120.0, 180.0, 235.0])
@pytest.mark.parametrize("colour", [True, False])
def test_dots_are_found_on_dark_and_bright_blades(brightness: float, colour: bool) -> None:
    settings = replace(PLAIN, brightness=brightness, shade=0.0, dirt=0.05, noise=1.5, dot_level=140.0, colour=colour)
    scene, observation = seen(settings)
    assert observation.dots_left is not None
    right, wrong, _ = index_errors(observation.dots_left, scene.truth.dots("left"))
    assert right >= 0.97 * len(scene.truth.dots("left")) and wrong == 0


def test_motion_between_laser_off_and_laser_on_is_made_up_for() -> None:
    scene, observation = seen(replace(PLAIN, motion_px=(26.0, -15.0), angle=0.7))
    assert observation.valid and observation.dots_left is not None
    right, wrong, _ = index_errors(observation.dots_left, scene.truth.dots("left"))
    assert right >= 0.95 * len(scene.truth.dots("left")) and wrong <= 1
    assert_edges(scene, observation)


@pytest.mark.parametrize("side", [-1, 1])
def test_one_edge_is_one_edge_with_its_outward_side(side: int) -> None:
    scene, observation = seen(replace(PLAIN, view="one_edge", chord_m=3.4, centre_m=side * 1.4, angle=0.5))
    assert observation.valid
    assert_edges(scene, observation)


def test_an_edge_on_the_wrong_side_of_the_centre_points_outward_through_it() -> None:
    scene, observation = seen(replace(PLAIN, view="wrong_side", chord_m=3.4, centre_m=1.9, angle=0.5))
    assert_edges(scene, observation)
    edge = observation.edges[0]
    normal = np.array([np.cos(edge.line.theta), np.sin(edge.line.theta)])
    assert float(edge.outward @ normal) == pytest.approx(-1.0)


def test_a_blade_that_fills_the_image_has_a_distance_and_no_edge_and_says_why() -> None:
    scene, observation = seen(replace(PLAIN, view="no_edge", chord_m=6.5))
    assert observation.valid and observation.distance_m == pytest.approx(scene.truth.distance_m, rel=0.01)
    assert observation.edges == () and "no edge" in observation.reasons[0]


@pytest.mark.parametrize("shape", ["round", "square"])
@pytest.mark.parametrize("angle_deg", [10, 130, 260])
def test_the_tip_is_found_where_it_is(shape: str, angle_deg: float) -> None:
    settings = replace(
        PLAIN, view="tip", tip_m=0.35, tip_shape=shape, chord_m=0.8, angle=np.deg2rad(angle_deg), background="sky"
    )
    scene, observation = seen(settings)
    assert observation.tip is not None and scene.truth.tip_point_px is not None
    along = np.array([np.cos(scene.truth.heading), np.sin(scene.truth.heading)])
    away_m = float((observation.tip.point - scene.truth.tip_point_px) @ along) * settings.distance_m / 616
    assert abs(away_m) < 0.05


def test_dots_on_the_tower_behind_do_not_move_the_blade() -> None:
    scene, observation = seen(replace(PLAIN, background="tower", seed=12, angle=np.deg2rad(80), chord_m=0.6))
    assert (~scene.truth.on_blade).sum() > 5
    assert observation.points is not None and observation.distance_m is not None
    assert observation.distance_m == pytest.approx(scene.truth.distance_m, rel=0.01)
    assert observation.points[:, 0].max() < scene.settings.distance_m + 1.0


def test_full_images_are_measured_in_their_own_pixels() -> None:
    scene, observation = seen(replace(PLAIN, scale=4, angle=0.9, noise=2.0))
    assert observation.dots_left is not None
    places = {(int(r), int(c)): uv for uv, r, c in zip(*vars(scene.truth.dots("left")).values(), strict=True)}
    away = [uv - places[r, c] for uv, r, c in zip(*vars(observation.dots_left).values(), strict=True)]
    assert np.sqrt(np.mean(np.square(away))) < 0.6
    assert_edges(scene, observation, px=8.0)


def test_the_same_images_give_the_same_observation_bit_for_bit() -> None:
    scene = draw_scene(PLAIN)
    eye = Eye(scene.geometry)
    first, second = eye.observe(scene.frames), eye.observe(scene.frames)
    assert first.points is not None and second.points is not None
    assert first.points.tobytes() == second.points.tobytes()
    assert first.plane_covariance is not None and second.plane_covariance is not None
    assert first.plane_covariance.tobytes() == second.plane_covariance.tobytes()
    for one, two in zip(first.edges, second.edges, strict=True):
        assert (one.line, one.sigma_theta, one.sigma_rho_px) == (two.line, two.sigma_theta, two.sigma_rho_px)


def test_distances_cover_the_truth_at_their_claimed_sigma() -> None:
    errors = []
    for seed in range(16):
        scene, observation = seen(
            replace(PLAIN, seed=300 + seed, angle=0.39 * seed, distance_m=2 + 0.22 * seed, baseline_m=0.1, noise=2.5)
        )
        assert observation.distance_m is not None and observation.distance_sigma_m is not None
        errors.append((observation.distance_m - scene.truth.distance_m) / observation.distance_sigma_m)
    assert 0.4 < np.sqrt(np.mean(np.square(errors))) < 1.6


def test_without_laser_light_it_refuses_and_says_what_it_saw() -> None:
    scene = draw_scene(PLAIN)
    dark = replace(scene.frames, left_laser=scene.frames.left, right_laser=scene.frames.right)
    observation = Eye(scene.geometry).observe(dark)
    assert not observation.valid and "spots" in observation.reasons[0] and observation.distance_m is None
    assert len(observation.reasons) == 1
    assert observation.exposure == pytest.approx(float(scene.frames.left.mean()), abs=3)


@pytest.mark.parametrize(("grey", "says"), [(0.0, "dark"), (6.0, "dark"), (255.0, "overexposed")])
def test_of_an_image_that_is_dark_or_overexposed_it_says_so(grey: float, says: str) -> None:
    scene = draw_scene(PLAIN)
    image = np.full_like(scene.frames.left_laser, grey)
    frames = replace(scene.frames, left=image, right=image, left_laser=image, right_laser=image)
    observation = Eye(scene.geometry).observe(frames)
    assert not observation.valid and says in observation.reasons[-1]
    assert observation.exposure == grey


def test_a_missing_image_is_a_refusal_and_a_wrong_size_an_error() -> None:
    scene = draw_scene(PLAIN)
    eye = Eye(scene.geometry)
    assert not eye.observe(replace(scene.frames, left_laser=None)).valid
    assert scene.frames.right is not None
    with pytest.raises(ValueError, match="612 × 512"):
        eye.observe(replace(scene.frames, right=scene.frames.right[:100]))


@pytest.mark.parametrize("colour", [True, False])
@pytest.mark.parametrize("background", ["horizon", "clutter"])
def test_two_laser_on_images_alone_give_dots_matches_and_distance(colour: bool, background: Behind) -> None:
    scene = draw_scene(replace(PLAIN, angle=1.1, colour=colour, background=background, baseline_m=0.15))
    observation = Eye(scene.geometry).observe(replace(scene.frames, left=None, right=None))
    assert observation.valid and observation.distance_m == pytest.approx(scene.truth.distance_m, rel=0.01)
    for found, side in ((observation.dots_left, "left"), (observation.dots_right, "right")):
        assert found is not None
        right, wrong, rms = index_errors(found, scene.truth.dots(side))
        assert right >= 0.9 * len(scene.truth.dots(side)) and wrong == 0 and rms < 0.25
    assert_edges(scene, observation)


@pytest.mark.parametrize(
    "settings",
    [
        replace(PLAIN, brightness=232.0, dot_level=160.0, shade=0.0),
        replace(PLAIN, dot_streak=2.0, motion_blur_px=4.0, dot_level=150.0),
        replace(PLAIN, brightness=90.0, noise=3.5),
    ],
    ids=["burnt out", "streaked and blurred", "noisy"],
)
def test_dots_are_centred_to_a_tenth_of_a_pixel_and_say_how_well(settings: SceneSettings) -> None:
    scene = draw_scene(settings)
    frames, eye = scene.frames, Eye(scene.geometry)
    assert frames.left is not None and frames.left_laser is not None
    spots = find_spots(green(frames.left), green(frames.left_laser))
    true = scene.truth.dots("left").uv
    nearest = np.hypot(*(true[:, None] - spots.uv[None]).transpose(2, 0, 1)).argmin(axis=1)
    errors = spots.uv[nearest] - true
    assert np.sqrt(np.mean(errors**2)) < 0.12
    assert 0.6 < np.sqrt(np.mean((errors / spots.sigma_px[nearest, None]) ** 2)) < 1.5
    assert eye.observe(frames).valid


@pytest.mark.parametrize("baseline_m", [0.05, 0.12, 0.20, 0.30])
def test_every_match_is_right_at_every_baseline(baseline_m: float) -> None:
    for seed in range(6):
        settings = replace(PLAIN, seed=70 + seed, baseline_m=baseline_m, distance_m=1.6 + 0.8 * seed, angle=0.9 * seed)
        scene, observation = seen(replace(settings, background="tower", motion_px=(9.0 * seed - 20, 12.0)))
        assert observation.dots_right is not None
        right, wrong, _ = index_errors(observation.dots_right, scene.truth.dots("right"))
        assert wrong == 0 and right > 8


def test_points_cover_the_truth_at_their_claimed_sigma() -> None:
    errors = []
    for seed in range(6):
        scene, observation = seen(replace(PLAIN, seed=500 + seed, angle=1.0 * seed, baseline_m=0.05 + 0.05 * seed))
        assert observation.dots_left is not None and observation.points is not None
        assert observation.sigma_m is not None
        near = np.abs(observation.points[:, None] - scene.truth.points[None])
        truth = scene.truth.points[np.nanargmin(near[..., 1] + near[..., 2], axis=1)]
        errors += ((observation.points[:, 0] - truth[:, 0]) / observation.sigma_m).tolist()
    assert 0.7 < np.sqrt(np.mean(np.square(errors))) < 1.4


def test_one_eye_and_the_laser_still_give_a_distance() -> None:
    scene = draw_scene(replace(PLAIN, laser_position_m=(0.0, 0.25, -0.1)))
    observation = Eye(scene.geometry).observe(replace(scene.frames, right=None, right_laser=None))
    assert observation.valid and observation.distance_m == pytest.approx(scene.truth.distance_m, rel=0.03)


def test_laser_off_images_of_something_else_do_not_blind_the_eye() -> None:
    scene = draw_scene(replace(PLAIN, brightness=60.0))
    assert scene.frames.left_laser is not None
    burnt = np.full_like(scene.frames.left_laser, 255)
    observation = Eye(scene.geometry).observe(replace(scene.frames, left=burnt, right=burnt))
    assert observation.valid, observation.reasons
    assert observation.distance_m == pytest.approx(scene.truth.distance_m, rel=0.01)
    assert_edges(scene, observation)
