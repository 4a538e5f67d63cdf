"""Camchain files: what is written comes back, axes are converted as geometry says, and mistakes are named with their
line."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from devices.camchain_file import read_camchain, write_camchain
from vision.camchain import CamchainError, format_camchain, parse_camchain
from vision.camera import Camera, StereoPair
from vision.capture import rotation_of

GOOD = """\
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.1, 0.02, 0.0003, -0.0004]
  distortion_model: radtan
  intrinsics: [2464.0, 2463.5, 1223.0, 1024.0]
  resolution: [2448, 2048]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.2]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  distortion_coeffs: [0, 0, 0, 0]
  distortion_model: radtan
  intrinsics: [2460, 2460, 1220, 1020]
  resolution: [2448, 2048]
"""

cameras = st.builds(
    Camera,
    st.just(2448),
    st.just(2048),
    st.floats(1000, 5000),
    st.floats(1000, 5000),
    st.floats(1000, 1500),
    st.floats(800, 1200),
    st.tuples(*[st.floats(-0.3, 0.3)] * 2, *[st.floats(-0.01, 0.01)] * 2),
    st.sampled_from(["radtan", "equidistant"]),
)


@given(left=cameras, right=cameras, angles=st.tuples(*[st.floats(-0.2, 0.2)] * 3), baseline=st.floats(0.02, 1.0))
@settings(max_examples=50, deadline=None, derandomize=True, phases=[Phase.generate])
def test_what_is_written_is_read_again(left: Camera, right: Camera, angles: tuple, baseline: float) -> None:
    stereo = StereoPair(left, right, rotation_of(*angles), np.array([0.01, -baseline, 0.003]))
    again = parse_camchain(format_camchain(stereo))
    assert (again.left, again.right) == (left, right)
    assert np.allclose(again.rotation, stereo.rotation, atol=1e-12)
    plain = yaml.safe_load(format_camchain(stereo))  # as another program reads it: nothing but numbers, however small
    for number, eye in enumerate((left, right)):
        assert tuple(plain[f"cam{number}"]["distortion_coeffs"]) == eye.distortion
        assert plain[f"cam{number}"]["distortion_model"] == eye.lens
    assert all(isinstance(value, float) for row in plain["cam1"]["T_cn_cnm1"] for value in row)
    assert np.allclose(again.translation, stereo.translation, atol=1e-12)


def test_a_point_lands_where_opencv_projects_it() -> None:
    """Both eyes, through the file, against cv2.projectPoints with the file's own numbers."""
    stereo = parse_camchain(
        GOOD.replace("[1.0, 0.0, 0.0, -0.2]", "[0.99995, 0.0, 0.0099998, -0.2]").replace(
            "[0.0, 0.0, 1.0, 0.0]", "[-0.0099998, 0.0, 0.99995, 0.01]"
        )
    )
    chain = yaml.safe_load(format_camchain(stereo))
    ours = np.array([[3.0, 0.4, -0.2], [2.0, -0.3, 0.5]])
    theirs = np.column_stack([ours[:, 1], ours[:, 2], ours[:, 0]])  # right, down, forward
    motion = np.array(chain["cam1"]["T_cn_cnm1"])
    for number, turn, shift, camera, points in (
        (0, np.eye(3), np.zeros(3), stereo.left, ours),
        (1, motion[:3, :3], motion[:3, 3], stereo.right, ours @ stereo.rotation.T + stereo.translation),
    ):
        fx, fy, cx, cy = chain[f"cam{number}"]["intrinsics"]
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
        distortion = np.array(chain[f"cam{number}"]["distortion_coeffs"])
        expected = cv2.projectPoints(theirs, cv2.Rodrigues(turn)[0], shift, matrix, distortion)[0].reshape(-1, 2)
        assert np.allclose(camera.project(points), expected, atol=1e-6)


def test_a_right_camera_to_the_right_has_its_baseline_along_minus_y() -> None:
    stereo = parse_camchain(GOOD)
    assert np.allclose(stereo.translation, [0, -0.2, 0])
    assert stereo.baseline_m == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        (("intrinsics: [2464.0, 2463.5, 1223.0, 1024.0]", "intrinsics: [2464.0, 2463.5]"), 6, "[fx, fy, cx, cy]"),
        (("intrinsics: [2464.0, 2463.5, 1223.0, 1024.0]", "intrinsics: [8.5, 8.5, 1223, 1024]"), 6, "8.5"),
        (("intrinsics: [2460, 2460, 1220, 1020]", "intrinsics: [2460, 2460, 9220, 1020]"), 18, "outside"),
        (("camera_model: pinhole", "camera_model: omni"), 3, "pinhole"),
        (("distortion_model: radtan", "distortion_model: fov"), 5, "pinhole-radtan or pinhole-equi"),
        (("-0.2]", "-200.0]"), 11, "in metres"),
        (("[1.0, 0.0, 0.0, -0.2]", "[1.0, 0.5, 0.0, -0.2]"), 11, "rotation"),
        (("[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 1.0]"), 11, "4 x 4"),
        (("resolution: [2448, 2048]", "resolution: [a, b]"), 7, "numbers"),
        (("[-0.1, 0.02, 0.0003, -0.0004]", "[-0.1, 0.02, .nan, 0]"), 4, "finite"),
        (("cam1:", "cam2:"), 1, "cam1 is missing"),
        (("  camera_model: pinhole\n", ""), 2, "camera_model"),
        (("cam0:\n", "cam0: [\n"), 3, "not YAML"),
        (("[-0.1, 0.02, 0.0003, -0.0004]", "!!python/object/apply:os.system [ls]"), 4, "distortion_coeffs"),
    ],
)
def test_a_mistake_is_named_with_its_line(change: tuple[str, str], line: int, words: str) -> None:
    text = GOOD.replace(*change, 1)
    assert text != GOOD
    with pytest.raises(CamchainError) as caught:
        parse_camchain(text, "rig.yaml")
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("rig.yaml:")
    assert abs(int(message.split(":")[1]) - line) <= 1
    assert words in message


@pytest.mark.parametrize("text", ["", "[]", "3", "cam0: 1\ncam1: 2", "cam0: {}\ncam1: {}", "a: &a [*a]", "\x00"])
def test_anything_else_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(CamchainError) as caught:
        parse_camchain(text)
    assert "\n" not in str(caught.value)


def test_files_come_back_and_missing_ones_say_so(tmp_path: Path) -> None:
    stereo = parse_camchain(GOOD)
    write_camchain(tmp_path / "chain.yaml", stereo)
    assert read_camchain(tmp_path / "chain.yaml").left == stereo.left
    assert [p.name for p in tmp_path.iterdir()] == ["chain.yaml"]
    with pytest.raises(CamchainError, match="no such file"):
        read_camchain(tmp_path / "none.yaml")
    (tmp_path / "picture.png").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(CamchainError, match="not a text file"):
        read_camchain(tmp_path / "picture.png")
