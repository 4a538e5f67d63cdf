"""`mission calibrate`: from files that people have to a camchain, a report, and one line when something is wrong."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from devices.camchain_file import read_camchain
from mission.cli.main import main
from vision.camera import Camera, LaserGrid, StereoPair
from vision.capture import rotation_of

LEFT = Camera(1200, 1000, 1210.0, 1208.0, 602.0, 495.0, (-0.1, 0.04, 0.0, 0.0))
STEREO = StereoPair(LEFT, LEFT, rotation_of(0.0, 0.01, -0.02), np.array([0.0, -0.2, 0.0]))


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    try:
        code = main([str(argument) for argument in ("calibrate", *arguments)])
    except SystemExit as end:
        code = end.code
    told = capsys.readouterr()
    return int(code or 0), told.out, told.err


def corner_file(path: Path, **changes: object) -> Path:
    """Twelve well-tilted views of an 8 x 5 board."""
    rng = np.random.default_rng(1)
    v, u = (g.ravel() for g in np.mgrid[0:5, 0:8])
    left, right = [], []
    while len(left) < 12:
        turn = rotation_of(0.1, *np.deg2rad(rng.uniform(-35, 35, 2)))
        flat = np.column_stack([0 * u, (u - 3.5) * 0.05, (v - 2) * 0.05])
        points = flat @ turn.T + np.array([rng.uniform(0.7, 1.1), rng.uniform(-0.15, 0.3), rng.uniform(-0.2, 0.2)])
        eyes = LEFT.project(points), LEFT.project(points @ STEREO.rotation.T + STEREO.translation)
        if all(((eye > 0) & (eye < (1199, 999))).all() for eye in eyes):
            left.append((eyes[0] + rng.normal(0, 0.05, (40, 2))).tolist())
            right.append((eyes[1] + rng.normal(0, 0.05, (40, 2))).tolist())
    content = {
        "image_size": [1200, 1000],
        "object_points": np.column_stack([u, v, 0 * u]).tolist(),
        "left": left,
        "right": right,
        "square_mm": 50,
        **changes,
    }
    path.write_text(json.dumps(content))
    return path


def test_corners_become_a_camchain_and_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = corner_file(tmp_path / "corners.json")
    code, out, _ = run(capsys, source, "--out", tmp_path / "chain.yaml", "--report", tmp_path / "report")
    assert code == 0
    found = read_camchain(tmp_path / "chain.yaml")
    assert found.left.fx == pytest.approx(LEFT.fx, rel=3e-3)
    assert np.allclose(found.translation, STEREO.translation, atol=1e-3)
    assert np.allclose(found.rotation, STEREO.rotation, atol=3e-3)
    text = (tmp_path / "report" / "calibration.txt").read_text()
    assert text in out
    for words in ("reprojection", "epipolar", "coverage", "tilted by", "fit            free"):
        assert words in text
    picture = cv2.imread(str(tmp_path / "report" / "coverage.png"))
    assert picture.shape[1] > 900
    assert "warning" not in out


def test_a_laser_is_calibrated_from_dots_on_walls(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    corner_file(tmp_path / "corners.json")
    run(capsys, tmp_path / "corners.json", "--out", tmp_path / "chain.yaml")
    stereo = read_camchain(tmp_path / "chain.yaml")
    laser = LaserGrid(7, 9, (np.deg2rad(30), np.deg2rad(30)), np.array([0.0, 0.1, -0.06]))
    walls = []
    for distance in (2.0, 4.0):
        rays = laser.directions().reshape(-1, 3)
        points = laser.position + rays * (distance / rays[:, 0])[:, None]
        grid = [(k // 9, k % 9) for k in range(63)]
        left = stereo.left.project(points)
        right = stereo.right.project(points @ stereo.rotation.T + stereo.translation)
        walls.append(
            {
                "left": [[*g, *uv] for g, uv in zip(grid, left.tolist(), strict=True)],
                "right": [[*g, *uv] for g, uv in zip(grid[3:], right.tolist()[3:], strict=True)],
            }
        )
    (tmp_path / "walls.json").write_text(json.dumps({"walls": walls}))
    arguments = ("--laser", "--camchain", tmp_path / "chain.yaml", "--rows", 7, "--columns", 9)
    code, out, _ = run(capsys, tmp_path / "walls.json", *arguments)
    assert code == 0
    section = re.search(r"fan_deg: ([\d.]+), position_m: \[(.+?)\]", out)
    assert float(section[1]) == pytest.approx(30, abs=0.05)
    assert np.allclose([float(v) for v in section[2].split(",")], laser.position, atol=2e-3)
    code, _, err = run(capsys, tmp_path / "walls.json", "--laser", "--camchain", tmp_path / "chain.yaml", "--rows", 3)
    assert code == 2
    assert "outside a grid of 3 rows" in err


@pytest.mark.parametrize("rows", [5, 6])
def test_pictures_of_a_board_are_searched_in_pairs(
    rows: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A board of 8 x 6 corners looks the same upside down, and is held so in some pictures."""
    rng = np.random.default_rng(4)
    squares = np.kron(np.indices((rows + 1, 9)).sum(0) % 2, np.ones((60, 60))).astype(np.uint8) * 200 + 30
    board = cv2.copyMakeBorder(squares, 60, 60, 60, 60, cv2.BORDER_CONSTANT, value=230)
    half = np.array([board.shape[1], board.shape[0]]) / 2
    size_m = 0.05
    for k, roll in enumerate((0.05, 1.5, 2.0, 3.1, -1.6)):
        turn = rotation_of(roll, *np.deg2rad(rng.uniform(-30, 30, 2)))
        outline = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        flat = np.column_stack([np.zeros(4), outline / 60 * size_m])
        points = flat @ turn.T + np.array([1.0, 0.1, 0.0])
        for side, shift in (("left", 0.0), ("right", -0.2)):
            seen = (points + np.array([0, shift, 0])) @ np.eye(3)
            uv = 500 * seen[:, 1:] / seen[:, :1] + np.array([249.5, 199.5])
            warp = cv2.getPerspectiveTransform((outline + half).astype(np.float32), uv.astype(np.float32))
            image = cv2.warpPerspective(board, warp, (500, 400), borderValue=230)
            cv2.imwrite(str(tmp_path / f"{side}_{k}.png"), image)
    arguments = ("--board", f"8x{rows}", "--square-mm", 50, "--out", tmp_path / "new" / "chain.yaml", "--fit", "free")
    code, out, err = run(capsys, tmp_path, *arguments)
    assert code == 0, err
    assert read_camchain(tmp_path / "new" / "chain.yaml").baseline_m == pytest.approx(0.2, rel=0.03)
    assert "views          5" in out


def test_pictures_that_cannot_be_used_are_named_and_the_others_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    test_pictures_of_a_board_are_searched_in_pairs(5, tmp_path, capsys)
    cv2.imwrite(str(tmp_path / "left_alone.png"), np.full((400, 500), 200, np.uint8))
    for side in ("left", "right"):
        cv2.imwrite(str(tmp_path / f"{side}_wall.png"), np.full((400, 500), 128, np.uint8))
        cv2.imwrite(str(tmp_path / f"{side}_small.png"), np.full((100, 100), 128, np.uint8))
        (tmp_path / f"{side}_broken.png").write_bytes((tmp_path / "left_0.png").read_bytes()[:2000])
    (tmp_path / "left_small.png").write_bytes((tmp_path / "left_1.png").read_bytes())
    arguments = ("--board", "8x5", "--square-mm", 50, "--out", tmp_path / "chain.yaml")
    code, out, err = run(capsys, tmp_path, *arguments)
    assert (code, err) == (0, "")
    assert re.search(r"^wall +- .*no board in the left picture, no board in the right picture$", out, re.M)
    for words in ("left_alone.png: no right picture", "left_broken.png: not an image", "small: 100 x 100 px, the"):
        assert re.search(f"^left out: .*{words}", out, re.M), out
    assert "views          5" in out and "warning: there are only 5 views" in out


def test_pictures_without_the_board_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for side in ("left", "right"):
        cv2.imwrite(str(tmp_path / f"{side}_0.png"), np.full((120, 160), 128, np.uint8))
    code, _, err = run(capsys, tmp_path, "--board", "11x4", "--square-mm", 50)
    assert code == 2
    assert "is --board right?" in err


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"left": [[[1, 2]]]}, "12"),
        ({"image_size": [0, 10]}, "image_size.0"),
        ({"image_size": [600, 500]}, "outside an image_size of 600 x 500"),
        ({"object_points": "none"}, "object_points"),
        ({"square_mm": None}, "baseline"),
        ({"left": [None] * 12}, "at least 3"),
    ],
)
def test_mistakes_in_a_corner_file_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, object], words: str
) -> None:
    source = corner_file(tmp_path / "corners.json", **changes)
    code, out, err = run(capsys, source, "--out", tmp_path / "chain.yaml")
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert words in err
    assert not (tmp_path / "chain.yaml").exists()


def test_sources_that_are_nothing_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "empty").mkdir()
    for arguments, words in (
        ((tmp_path / "none.json",), "no such file"),
        ((tmp_path / "broken.json",), "invalid JSON"),
        ((tmp_path / "empty",), "no pairs of pictures"),
        ((tmp_path / "empty", "--board", "9"), "9x6"),
        ((tmp_path / "broken.json", "--laser"), "--camchain"),
        ((tmp_path / "broken.json", "--laser", "--camchain", tmp_path / "none.yaml"), "no such file"),
    ):
        code, _, err = run(capsys, *arguments)
        assert (code, err.count("\n")) == (2, 1), err
        if words != "9x6":
            assert words in err
