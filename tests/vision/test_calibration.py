"""Calibration: boards and walls drawn from known cameras give those cameras back; real, badly conditioned corners are
called so."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from vision.board import BoardViews, board_points, find_corners, turned_alike
from vision.calibration import calibrate_stereo, fit_camera
from vision.calibration_fit import CalibrationError, Nominal
from vision.calibration_laser import WallDots, fit_laser, triangulated
from vision.calibration_pairs import epipolar_error
from vision.camera import Camera, LaserGrid, StereoPair
from vision.capture import rotation_of

LEFT = Camera(2448, 2048, 2470.0, 2468.0, 1230.0, 1015.0, (-0.12, 0.05, 0.0004, -0.0003))
RIGHT = Camera(2448, 2048, 2455.0, 2457.0, 1215.0, 1030.0, (-0.11, 0.04, -0.0002, 0.0005))
STEREO = StereoPair(LEFT, RIGHT, rotation_of(0.01, -0.02, 0.03), np.array([0.004, -0.2, 0.003]))
NOMINAL = Nominal(8.5 / 0.00345, 0.2)
SQUARE = 0.06
CORNERS = Path(__file__).parents[3] / "shared" / "data" / "chessboard_corners.json"


def board_views(tilt_deg: float, count: int, rng: np.random.Generator, noise_px: float = 0.1) -> BoardViews:
    """A 9 x 6 board held before the cameras at random, tilted by up to so much."""
    board = board_points(9, 6)
    left, right = [], []
    while len(left) < count:
        angles = np.deg2rad(rng.uniform(-tilt_deg, tilt_deg, 2))
        turn = rotation_of(rng.uniform(-0.3, 0.3), *angles)
        flat = np.column_stack([np.zeros(54), (board[:, 0] - 4) * SQUARE, (board[:, 1] - 2.5) * SQUARE])
        points = flat @ turn.T + np.array([rng.uniform(0.8, 1.4), rng.uniform(-0.3, 0.4), rng.uniform(-0.3, 0.3)])
        eyes = LEFT.project(points), RIGHT.project(points @ STEREO.rotation.T + STEREO.translation)
        if all(((eye > 5) & (eye < (2443, 2043))).all() for eye in eyes):
            left.append(eyes[0] + rng.normal(0, noise_px, (54, 2)))
            right.append(eyes[1] + rng.normal(0, noise_px, (54, 2)))
    return BoardViews((2448, 2048), board, tuple(left), tuple(right), SQUARE)


def test_well_tilted_boards_give_the_cameras_back_with_the_rotation_between_them() -> None:
    fit = calibrate_stereo(board_views(35, 16, np.random.default_rng(1)), NOMINAL)
    assert fit.chosen == "free"
    assert fit.warnings == ()
    for found, true in ((fit.stereo.left, LEFT), (fit.stereo.right, RIGHT)):
        assert found.fx == pytest.approx(true.fx, rel=2e-3)
        assert (found.cx, found.cy) == pytest.approx((true.cx, true.cy), abs=4)
        grid = np.column_stack([np.ones(25), *[g.ravel() for g in np.meshgrid(*[np.linspace(-0.35, 0.35, 5)] * 2)]])
        assert np.abs(found.project(grid) - true.project(grid)).max() < 5
    turn = fit.stereo.rotation @ STEREO.rotation.T
    assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) < 0.15
    assert np.allclose(fit.stereo.translation, STEREO.translation, atol=1e-3)
    assert fit.left.rms_px < 0.2
    assert fit.epipolar_px < 0.25
    assert abs(fit.left.camera.fx - LEFT.fx) < 4 * fit.left.focal_sigma_px


def test_hardly_tilted_boards_are_called_badly_conditioned_and_held_by_the_nominal_lens() -> None:
    fit = calibrate_stereo(board_views(2, 4, np.random.default_rng(2), 0.3), NOMINAL)
    assert fit.chosen == "held"
    assert fit.stereo.left.fx == fit.stereo.right.fx == NOMINAL.focal_px
    text = " ".join(fit.warnings)
    for words in ("tilt", "views", "held at the nominal"):
        assert words in text
    assert np.allclose(fit.stereo.translation[1], -0.2, atol=0.01)


def test_the_user_may_insist_on_either_fit() -> None:
    views = board_views(2, 4, np.random.default_rng(2), 0.3)
    free = calibrate_stereo(views, NOMINAL, "free")
    assert free.chosen == "free"
    assert "do not trust" in free.warnings[-1]
    good = board_views(35, 12, np.random.default_rng(3))
    assert calibrate_stereo(good, NOMINAL, "held").stereo.left.fx == NOMINAL.focal_px
    with pytest.raises(CalibrationError, match="nominal focal length"):
        calibrate_stereo(good, None, "held")


@pytest.mark.skipif(not CORNERS.exists(), reason="the real corners are not beside the project")
def test_real_badly_conditioned_corners_are_held_by_the_nominal_lens() -> None:
    data = json.loads(CORNERS.read_text())
    views = BoardViews(
        tuple(data["image_size"]),
        np.array(data["object_points"]),
        tuple(np.array(v) for v in data["left"]),
        tuple(np.array(v) for v in data["right"]),
    )
    nominal = Nominal(data["nominal"]["focal_length_mm"] / data["nominal"]["pixel_um"] * 1000, 0.05)
    fit = calibrate_stereo(views, nominal)
    assert fit.chosen == "held"
    assert fit.stereo.left.fx == pytest.approx(2463.8, abs=0.1)
    assert fit.free[0].camera.fx > 3300 and 2300 < fit.free[1].camera.fx < 2700  # they wander, as the data's note says
    text = " ".join(fit.warnings)
    assert "the left focal length comes out as 35" in text
    assert "tilted by" in text
    assert fit.left.rms_px < 1.0 and fit.right.rms_px < 1.0
    assert fit.epipolar_px < 1.5
    assert fit.stereo.baseline_m == pytest.approx(0.05)
    assert fit.scale_from == "baseline"
    assert abs(fit.stereo.translation[1]) > 0.9 * 0.05  # side by side


def test_a_pair_that_was_not_taken_at_one_time_is_left_out_and_named() -> None:
    views = board_views(35, 12, np.random.default_rng(1))
    moved = replace(views, right=(views.right[1], *views.right[1:]), names=tuple("abcdefghijkl"))
    fit = calibrate_stereo(moved)
    assert [view.name for view in fit.views if view.left_out] == ["a"]
    assert "do not belong together" in fit.views[0].left_out
    assert np.allclose(fit.stereo.translation, STEREO.translation, atol=2e-3)
    assert fit.rms_px < 0.3 and fit.epipolar_px < 0.3


def test_a_view_with_misled_corners_is_left_out_of_its_camera() -> None:
    rng = np.random.default_rng(6)
    views = board_views(35, 12, rng)
    blurred = views.left[4] + rng.normal(0, 4, (54, 2))
    fit = calibrate_stereo(replace(views, left=(*views.left[:4], blurred, *views.left[5:])))
    assert [view.name for view in fit.views if view.left_out] == ["view 5"]
    assert "left picture" in fit.views[4].left_out and np.isnan(fit.views[4].left_px) and fit.views[4].right_px < 0.3
    assert fit.stereo.left.fx == pytest.approx(LEFT.fx, rel=2e-3)


def test_cameras_that_never_looked_at_the_same_board_are_refused() -> None:
    views = board_views(35, 12, np.random.default_rng(1))
    with pytest.raises(CalibrationError, match="do not fit together"):
        calibrate_stereo(replace(views, right=views.right[3:] + views.right[:3]))


def test_corners_in_another_order_than_the_boards_are_refused() -> None:
    views = board_views(35, 6, np.random.default_rng(1))
    order = np.random.default_rng(0).permutation(54)
    with pytest.raises(CalibrationError, match="right images miss those of the board"):
        calibrate_stereo(replace(views, right=tuple(view[order] for view in views.right)))


def test_swapped_cameras_are_noticed() -> None:
    views = board_views(35, 12, np.random.default_rng(1))
    fit = calibrate_stereo(replace(views, left=views.right, right=views.left))
    assert "swapped" in " ".join(fit.warnings)


def test_few_views_are_warned_of_though_they_tilt_and_a_lens_is_asked_for_where_it_would_help() -> None:
    few = calibrate_stereo(board_views(35, 5, np.random.default_rng(8), 0.05))
    assert few.chosen == "free" and "only 5 views" in " ".join(few.warnings)
    flat = calibrate_stereo(board_views(2, 8, np.random.default_rng(2), 0.3))
    assert "--focal-mm" in flat.warnings[-1]


@pytest.mark.parametrize(("columns", "rows"), [(8, 6), (7, 5), (6, 6)])
@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
def test_both_eyes_count_a_board_that_looks_alike_upside_down_from_one_corner(
    columns: int, rows: int, quarters: int
) -> None:
    if columns != rows and quarters % 2:
        return  # such a turn exchanges rows and columns, which a search for so many of them does not
    corners = board_points(columns, rows)[:, :2] * 40 + 200
    turn = np.array([[0.1, -0.995], [0.995, 0.1]])  # a board held on its side
    left, right = corners @ turn.T, corners @ turn.T * 0.97 + np.array([-70.0, 9.0])
    counted = np.rot90(right.reshape(rows, columns, 2), quarters).reshape(-1, 2)
    assert np.allclose(turned_alike(left, counted, columns, rows), right)


def test_epipolar_error_is_that_of_the_points() -> None:
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(1, 4, 200), rng.uniform(-0.4, 0.4, (200, 2))])
    left, right = LEFT.project(points), RIGHT.project(points @ STEREO.rotation.T + STEREO.translation)
    assert epipolar_error(STEREO, [(left, right)]) < 1e-3
    assert epipolar_error(STEREO, [(left, right + np.array([0, 2.0]))]) == pytest.approx(2.0, rel=0.1)
    assert np.allclose(triangulated(LEFT.rays(left), RIGHT.rays(right), STEREO), points, atol=1e-6)


def test_corners_are_found_in_a_drawn_picture() -> None:
    squares = np.kron(np.indices((7, 10)).sum(0) % 2, np.ones((40, 40))).astype(np.uint8) * 200 + 30
    image = cv2.copyMakeBorder(squares, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=230)
    warp = np.array([[0.9, 0.12, 20.0], [-0.08, 0.95, 50.0], [1e-4, 5e-5, 1.0]])
    image = cv2.warpPerspective(image, warp, (640, 520), borderValue=230)
    found = find_corners(image, 9, 6)
    corners = board_points(9, 6)[:, :2] * 40 + 100 - 0.5
    truth = cv2.perspectiveTransform(corners[None], warp)[0]
    truth = truth[np.argmin(np.linalg.norm(truth[:, None] - found[None], axis=2), axis=0)]
    assert np.sqrt(np.mean((found - truth) ** 2)) < 0.1
    assert find_corners(np.full((300, 300), 128, np.uint8), 9, 6) is None


def test_too_little_data_is_refused_in_words() -> None:
    views = board_views(30, 3, np.random.default_rng(1))
    with pytest.raises(CalibrationError, match="at least 3"):
        fit_camera(views.board, views.left[:2], (2448, 2048))
    with pytest.raises(CalibrationError, match="square"):
        calibrate_stereo(BoardViews((2448, 2048), views.board, views.left, views.right))
    apart = BoardViews((2448, 2048), views.board, (*views.left, *[None] * 3), (*[None] * 3, *views.right), SQUARE)
    with pytest.raises(CalibrationError, match="both cameras"):
        calibrate_stereo(apart, NOMINAL)


LASER = LaserGrid(
    11, 11, (np.deg2rad(28.6), np.deg2rad(27.9)), np.array([0.01, 0.1, -0.06]), rotation_of(0.02, -0.01, 0.015)
)


def wall(distance: float, lean: float, rng: np.random.Generator, noise_px: float = 0.15) -> WallDots:
    """The laser's dots on a wall that leans a little, as both eyes see them."""
    rays = LASER.directions().reshape(-1, 3)
    normal = np.array([-1.0, lean, 0.1])
    point = np.array([distance, 0.0, 0.0])
    points = LASER.position + rays * (((point - LASER.position) @ normal) / (rays @ normal))[:, None]
    row, column = (g.ravel() for g in np.mgrid[0:11, 0:11])
    left = LEFT.project(points) + rng.normal(0, noise_px, (121, 2))
    right = RIGHT.project(points @ STEREO.rotation.T + STEREO.translation) + rng.normal(0, noise_px, (121, 2))
    return WallDots(row, column, left, right)


def test_walls_at_several_distances_give_the_laser_back() -> None:
    rng = np.random.default_rng(5)
    fit = fit_laser([wall(d, 0.1 * d - 0.3, rng) for d in (2.0, 3.0, 5.0)], STEREO, LaserGrid(11, 11))
    assert fit.warnings == ()
    assert np.allclose(fit.laser.fan, LASER.fan, atol=np.deg2rad(0.1))
    assert np.allclose(fit.laser.position, LASER.position, atol=4e-3)
    assert np.allclose(fit.angles, (0.02, -0.01, 0.015), atol=1.5e-3)
    assert np.all(np.abs(fit.laser.position - LASER.position) < 4 * fit.position_sigma_m + 1e-4)
    assert fit.rms_px < 0.5
    assert np.allclose(fit.wall_distance_m, (2, 3, 5), rtol=0.01)


def test_walls_at_one_distance_are_warned_of() -> None:
    rng = np.random.default_rng(5)
    fit = fit_laser([wall(3.0, 0.0, rng), wall(3.1, 0.0, rng)], STEREO, LaserGrid(11, 11))
    assert any("one distance" in warning for warning in fit.warnings)
    with pytest.raises(CalibrationError, match="one wall"):
        fit_laser([wall(3.0, 0.0, rng)], STEREO, LaserGrid(11, 11))
