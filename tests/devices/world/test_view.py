"""What the drawn images show, and what the world says is in them."""

import cv2
import numpy as np
import pytest

from devices.world.lens import right_pose
from devices.world.motion import moved, smeared
from devices.world.renderer import Renderer
from devices.world.settings import WorldSettings
from devices.world.true_view import true_view
from devices.world.turbine import HUB, INSPECTED, SKY, TOWER, TurbineShape
from devices.world.view import draw
from vision.camera import Camera, LaserGrid, RigGeometry, StereoPair
from vision.capture import CameraPose, rotation_of

CAMERA = Camera(612, 512, 616.0, 616.0, 305.5, 255.5)
LASER = LaserGrid(position=np.array([0.0, 0.10, -0.06]))


def pair(camera: Camera, baseline_m: float = 0.2) -> RigGeometry:
    return RigGeometry(StereoPair(camera, camera, translation=np.array([0.0, -baseline_m, 0.0])), LASER)


def before(shape: TurbineShape, station: float, distance: float, sideways: float = 0.0) -> CameraPose:
    position = shape.blade_frame().to_ned(np.array([station, sideways, -distance]))
    return CameraPose(position, rotation_of(0.0, 0.0, np.deg2rad(shape.heading_deg)))


@pytest.fixture(scope="module")
def shape() -> TurbineShape:
    return TurbineShape(azimuth_deg=45.0, heading_deg=8.0, north_m=60.0, east_m=10.0)


@pytest.fixture(scope="module")
def renderer(shape) -> Renderer:
    return Renderer(shape, WorldSettings())


def test_spots_are_green_and_lie_where_the_world_says(renderer, shape):
    pose = before(shape, 20.0, 3.0)
    frames, truth = draw(renderer, pair(CAMERA), pose), true_view(renderer, pair(CAMERA), pose)
    assert len(truth.dots_left) > 80
    for off, on, dots in (
        (frames.left, frames.left_laser, truth.dots_left),
        (frames.right, frames.right_laser, truth.dots_right),
    ):
        glow = on.astype(float)[..., 1] - off[..., 1]
        for u, v in dots.uv[np.all((dots.uv > 8) & (dots.uv < [603, 503]), axis=1)]:
            x, y = round(u), round(v)
            patch = np.maximum(glow[y - 4 : y + 5, x - 4 : x + 5], 0.0)
            rows, columns = np.mgrid[y - 4 : y + 5, x - 4 : x + 5]
            centre = np.array([(patch * columns).sum(), (patch * rows).sum()]) / patch.sum()
            whole = truth.part[y - 4 : y + 5, x - 4 : x + 5]
            if off is frames.left and (whole != INSPECTED).any():
                continue  # part of the beam goes past the edge
            assert np.hypot(*(centre - [u, v])) < (0.4 if off is frames.left else 2.0)
            assert on[y, x, 1] > on[y, x, 0] and on[y, x, 1] > on[y, x, 2]


def test_true_spots_satisfy_stereo_and_the_lasers_rays(renderer, shape):
    geometry, pose = pair(CAMERA), before(shape, 12.0, 4.0)
    truth = true_view(renderer, geometry, pose)
    left = {
        (r, c): uv for r, c, uv in zip(truth.dots_left.row, truth.dots_left.column, truth.dots_left.uv, strict=True)
    }
    directions = LASER.directions()
    matched = 0
    for r, c, (u, v) in zip(truth.dots_right.row, truth.dots_right.column, truth.dots_right.uv, strict=True):
        if (r, c) in left:
            depth = CAMERA.fx * 0.2 / (left[r, c][0] - u)
            point = depth * CAMERA.rays(left[r, c][None])[0]
            along = (point - LASER.position) / np.linalg.norm(point - LASER.position)
            assert along @ directions[r, c] > 1 - 1e-9
            assert v == pytest.approx(left[r, c][1])
            matched += 1
    assert matched > 60


def test_spots_on_the_tower_behind_a_blade_are_told_apart():
    shape = TurbineShape(azimuth_deg=180.0)
    renderer = Renderer(shape, WorldSettings())
    truth = true_view(renderer, pair(CAMERA), before(shape, 36.0, 3.0, sideways=0.5))
    assert {INSPECTED, TOWER} <= set(truth.spot_part.tolist())
    for (u, v), part in zip(truth.dots_left.uv, truth.spot_part, strict=True):
        around = truth.part[round(v) - 1 : round(v) + 2, round(u) - 1 : round(u) + 2]
        assert part in around


@pytest.mark.parametrize("station", [4.0, 12.0, 37.5])
def test_edges_and_tip_lie_on_the_silhouette(renderer, shape, station):
    truth = true_view(renderer, pair(CAMERA), before(shape, station, 6.0))
    blade = (truth.part == INSPECTED).astype(np.uint8)
    outline = blade - cv2.erode(blade, np.ones((3, 3), np.uint8))
    away = cv2.distanceTransform(1 - outline, cv2.DIST_L2, 5)
    for edge in (truth.leading, truth.trailing, *([truth.tip[None]] if station > 30 else [])):
        inside = edge[np.all((edge > 3) & (edge < [608, 508]), axis=1)]
        assert len(inside) > 0
        assert away[inside[:, 1].round().astype(int), inside[:, 0].round().astype(int)].max() < 2.0


def test_from_afar_the_hub_and_the_three_blades_lie_where_the_world_says(renderer, shape):
    truth = true_view(renderer, pair(CAMERA), before(shape, 0.0, 45.0))
    assert truth.part[round(truth.hub[1]), round(truth.hub[0])] == HUB
    for number, angle in enumerate(truth.azimuths):
        u, v = truth.hub + 120.0 * np.array([np.cos(angle), np.sin(angle)])
        assert truth.part[round(v), round(u)] == INSPECTED + number
    assert np.rad2deg(truth.azimuths[0]) == pytest.approx(45.0 - 90.0, abs=2.0)


def test_only_the_laser_sets_the_images_of_a_standing_rig_apart(shape):
    renderer = Renderer(shape, WorldSettings.model_validate({"camera": {"noise": 0.0}}))
    frames = draw(renderer, pair(CAMERA), before(shape, 20.0, 3.0), lit=False)
    assert np.array_equal(frames.left, frames.left_laser)
    frames = draw(renderer, pair(CAMERA), before(shape, 20.0, 3.0))
    assert 0.002 < np.any(frames.left != frames.left_laser, axis=2).mean() < 0.1
    assert draw(renderer, pair(CAMERA), before(shape, 20.0, 3.0), laser=False).left_laser is None


def test_noise_has_the_deviation_asked_for_and_never_repeats(renderer, shape):
    pose = before(shape, 20.0, 3.0)
    one, other = (draw(renderer, pair(CAMERA), pose, laser=False, frame=frame).left for frame in (1, 2))
    again = draw(renderer, pair(CAMERA), pose, laser=False, frame=1).left
    assert np.array_equal(one, again)
    difference = one.astype(float) - other
    assert difference.std() / np.sqrt(2) == pytest.approx(renderer.settings.camera.noise, rel=0.1)


def test_antialiasing_smooths_the_outline_without_moving_it(shape):
    pose = before(shape, 38.0, 5.0)
    settings = {"camera": {"noise": 0.0, "vignette": 0.0}, "light": {"background": "plain", "clouds": 0.0}}
    soft = Renderer(shape, WorldSettings.model_validate(settings)).scenery(CAMERA, pose)
    settings["camera"]["antialias"] = False
    hard = Renderer(shape, WorldSettings.model_validate(settings)).scenery(CAMERA, pose)
    assert np.abs(soft.astype(float) - hard).mean() < 0.5
    changed = np.any(np.abs(soft.astype(int) - hard) > 8, axis=2)
    part = true_view(Renderer(shape, WorldSettings()), pair(CAMERA), pose).part
    outline = cv2.morphologyEx((part != SKY).astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((5, 5), np.uint8)) > 0
    assert changed.any() and (changed & ~outline).mean() < 1e-4


def test_a_distorted_lens_bends_image_and_truth_alike(shape):
    bent = Camera(612, 512, 616.0, 616.0, 300.0, 260.0, (-0.12, 0.03, 0.001, -0.002))
    renderer = Renderer(shape, WorldSettings.model_validate({"camera": {"noise": 0.0}}))
    pose = before(shape, 37.5, 4.0)
    frames, truth = draw(renderer, pair(bent), pose), true_view(renderer, pair(bent), pose)
    blade = (truth.part == INSPECTED).astype(np.uint8)
    away = cv2.distanceTransform(1 - (blade - cv2.erode(blade, np.ones((3, 3), np.uint8))), cv2.DIST_L2, 5)
    inside = truth.trailing[np.all((truth.trailing > 3) & (truth.trailing < [608, 508]), axis=1)]
    assert away[inside[:, 1].round().astype(int), inside[:, 0].round().astype(int)].max() < 3.0
    glow = frames.left_laser[..., 1].astype(float) - frames.left[..., 1]
    pixels = truth.dots_left.uv.round().astype(int)
    assert np.median(glow[pixels[:, 1], pixels[:, 0]]) > 50


def test_the_right_eye_sees_with_its_own_rotation(renderer, shape):
    turn = rotation_of(0.01, -0.02, 0.03)
    stereo = StereoPair(CAMERA, CAMERA, turn, np.array([0.01, -0.2, 0.005]))
    pose = before(shape, 20.0, 3.0)
    right = right_pose(RigGeometry(stereo, LASER), pose)
    points = np.array([[3.0, 0.2, -0.1], [5.0, -1.0, 0.4]])
    assert right.from_ned(pose.to_ned(points)) == pytest.approx(points @ turn.T + stereo.translation)


@pytest.mark.parametrize("shift", [(3.25, -2.5), (-4.0, 1.75), (0.5, 0.5), (900.0, 0.0)])
def test_motion_between_exposures_shifts_the_scene(shift):
    v, u = np.mgrid[0:120, 0:160]
    image = np.repeat((100 + 60 * np.sin(u / 9.0) * np.cos(v / 7.0))[..., None], 3, axis=2).astype(np.uint8)
    result = moved(image, shift)
    assert result.shape == image.shape
    if abs(shift[0]) < 100:
        expected = 100 + 60 * np.sin((u - shift[0]) / 9.0) * np.cos((v - shift[1]) / 7.0)
        assert np.abs(result[8:-8, 8:-8, 0] - expected[8:-8, 8:-8]).max() < 3.0


def test_motion_during_the_exposure_blurs_along_its_path_alone():
    image = np.zeros((64, 64, 3), np.uint8)
    image[:, 32] = 240
    along, across = smeared(image, (0.0, 6.0)), smeared(image, (6.0, 0.0))
    assert np.array_equal(along, image)
    assert across[32, :, 0].astype(int).sum() == pytest.approx(240, abs=8) and across[32, 32, 0] < 60


@pytest.mark.parametrize("background", ["fields", "sea", "plain"])
def test_the_ground_lies_below_the_horizon_and_the_sky_above(shape, background):
    settings = WorldSettings.model_validate({"light": {"background": background}})
    renderer = Renderer(shape, settings)
    pose = CameraPose(shape.hub, rotation_of(0.0, 0.0, np.deg2rad(shape.heading_deg + 180.0)))
    image = renderer.scenery(CAMERA, CameraPose(pose.position - 5 * shape.rotation[:, 0], pose.rotation)).astype(float)
    assert image[:200].mean() > image[320:].mean() + 20
    assert image[:60, :, 0].mean() > image[:60, :, 2].mean() + 10
