"""`mission calibrate` on drawn pictures of boards and walls: the program as people run it, against the rig that drew
them."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from devices.camchain_file import read_camchain, write_camchain
from vision.camera import Camera, LaserGrid, StereoPair
from vision.capture import Image, rotation_of

LEFT = Camera(800, 640, 810.0, 808.0, 404.0, 316.0, (-0.12, 0.04, 0.0005, -0.0004))
RIGHT = Camera(800, 640, 802.0, 803.0, 396.0, 322.0, (-0.11, 0.03, -0.0003, 0.0004))
STEREO = StereoPair(LEFT, RIGHT, rotation_of(0.008, -0.015, 0.02), np.array([0.003, -0.2, 0.002]))
LASER = LaserGrid(
    9, 11, (np.deg2rad(30.0), np.deg2rad(30.0)), np.array([0.01, 0.09, -0.05]), rotation_of(0.02, -0.01, 0.015)
)
SQUARE_M = 0.06


def ran(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mission.cli.main", "calibrate", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@cache
def rays_of(camera: Camera) -> np.ndarray:
    """The ray of every pixel (h * w, 3)."""
    v, u = (grid.ravel().astype(float) for grid in np.mgrid[0 : camera.height, 0 : camera.width])
    return camera.rays(np.column_stack([u, v]))


def seen_by(
    camera: Camera, rotation: np.ndarray, translation: np.ndarray, turn: np.ndarray, place: np.ndarray
) -> Image:
    """A camera's picture of a 9 x 6 board, each pixel looked up where its ray meets the board."""
    rays = rays_of(camera) @ rotation
    lens = -rotation.T @ translation
    normal = turn[:, 0]
    reach = ((place - lens) @ normal) / (rays @ normal)
    on_board = (lens + rays * reach[:, None] - place) @ turn[:, 1:] / SQUARE_M
    across, down = on_board[:, 0] + 5.0, on_board[:, 1] + 3.5
    soft = np.clip(np.sin(np.pi * across) * np.sin(np.pi * down) * 12, -1, 1)
    inside = (across > 0) & (across < 10) & (down > 0) & (down < 7)
    grey = np.where(inside, 130 + 95 * soft, 225.0)
    noise = np.random.default_rng(int(abs(place[1]) * 1e6)).normal(0, 2, grey.shape)
    return np.clip(grey + noise, 0, 255).reshape(camera.height, camera.width).astype(np.uint8)


def test_pictures_of_a_board_give_the_cameras_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    for side in ("left", "right"):
        (tmp_path / "boards" / side).mkdir(parents=True)
    for k in range(10):
        turn = rotation_of(rng.uniform(-0.2, 0.2), *np.deg2rad(rng.uniform(-32, 32, 2)))
        place = np.array([rng.uniform(0.95, 1.25), rng.uniform(-0.05, 0.25), rng.uniform(-0.15, 0.15)])
        for side, camera, rotation, shift in (
            ("left", LEFT, np.eye(3), np.zeros(3)),
            ("right", RIGHT, STEREO.rotation, STEREO.translation),
        ):
            cv2.imwrite(str(tmp_path / "boards" / side / f"{k:02d}.png"), seen_by(camera, rotation, shift, turn, place))
    out, report = tmp_path / "camchain.yaml", tmp_path / "report"
    done = ran(tmp_path / "boards", "--board", "9x6", "--square-mm", 60, "--out", out, "--report", report)
    assert done.returncode == 0, done.stderr
    found = read_camchain(out)
    for camera, true in ((found.left, LEFT), (found.right, RIGHT)):
        assert camera.fx == pytest.approx(true.fx, rel=5e-3) and camera.fy == pytest.approx(true.fy, rel=5e-3)
        assert (camera.cx, camera.cy) == pytest.approx((true.cx, true.cy), abs=5)
        places = np.column_stack([np.ones(25), *(g.ravel() for g in np.meshgrid(*[np.linspace(-0.3, 0.3, 5)] * 2))])
        assert np.abs(camera.project(places) - true.project(places)).max() < 5
    between = found.rotation @ STEREO.rotation.T
    assert np.degrees(np.arccos(min((np.trace(between) - 1) / 2, 1.0))) < 0.3
    assert np.allclose(found.translation, STEREO.translation, atol=2e-3)
    errors = [float(value) for value in re.findall(r"([\d.]+) px reprojection, ([\d.]+) px epipolar", done.stdout)[0]]
    assert max(errors) < 0.3
    page = (report / "calibration.html").read_text()
    assert "epipolar residual" in page and "data:image/png;base64," in page and page.count("<rect") >= 20
    assert cv2.imread(str(report / "coverage.png")).shape[1] > 900


def wall_pictures(folder: Path, distance: float, lean: float) -> None:
    """The laser's dots on a grey wall with some pattern, as both eyes see it, laser off and on."""
    folder.mkdir(parents=True)
    rays = LASER.directions().reshape(-1, 3)
    normal = np.array([-1.0, lean, 0.06])
    reach = ((np.array([distance, 0, 0]) - LASER.position) @ normal) / (rays @ normal)
    points = LASER.position + rays * reach[:, None]
    rng = np.random.default_rng(round(100 * distance))
    v, u = np.mgrid[0:640, 0:800].astype(float)
    for side, camera, seen in (
        ("left", LEFT, points),
        ("right", RIGHT, points @ STEREO.rotation.T + STEREO.translation),
    ):
        wall = 110 + 25 * np.sin(u / 90 + distance) + 15 * (v > 330)
        dots = np.zeros_like(wall)
        for at in camera.project(seen):
            dots += 100 * np.exp(-((u - at[0]) ** 2 + (v - at[1]) ** 2) / (2 * 1.8**2))
        for name, image in ((side, wall), (f"{side}_laser", wall + dots)):
            noisy = np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)
            cv2.imwrite(str(folder / f"{name}.png"), noisy)


def test_pictures_of_walls_give_the_laser_back(tmp_path: Path) -> None:
    for distance, lean in ((2.0, 0.1), (4.5, -0.1)):
        wall_pictures(tmp_path / "walls" / f"{distance:g}m", distance, lean)
    write_camchain(tmp_path / "camchain.yaml", STEREO)
    given = ("--laser", "--camchain", tmp_path / "camchain.yaml", "--rows", 9, "--columns", 11)
    done = ran(tmp_path / "walls", *given)
    assert done.returncode == 0, done.stderr
    section = re.search(r"fan_deg: ([\d.]+), position_m: \[(.+?)\], rotation_deg: \[(.+?)\]", done.stdout)
    assert section is not None
    assert float(section[1]) == pytest.approx(30.0, abs=0.25)
    assert np.allclose([float(value) for value in section[2].split(",")], LASER.position, atol=0.01)
    turned = np.rad2deg([0.02, -0.01, 0.015])
    assert np.allclose([float(value) for value in section[3].split(",")], turned, atol=0.25)
    wrong = ran(tmp_path / "walls", *given[:-1], 12)
    assert wrong.returncode == 2 and wrong.stderr.count("\n") == 1
    assert "shows 9 rows and 11 columns of dots" in wrong.stderr
    smaller = StereoPair(LEFT.shrunk(2), RIGHT.shrunk(2), STEREO.rotation, STEREO.translation)
    write_camchain(tmp_path / "camchain.yaml", smaller)
    other = ran(tmp_path / "walls", *given)
    assert other.returncode == 2 and "800 x 640 px, the camchain's camera 400 x 320" in other.stderr
