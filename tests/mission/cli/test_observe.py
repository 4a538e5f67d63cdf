"""`mission observe`: stored images in, what was seen out."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from devices.scenes import SceneSettings, draw_scene
from mission.cli.errors import CommandError
from mission.cli.observe import observe

SCENE = SceneSettings(seed=3, distance_m=3.0, chord_m=0.9, angle=0.6)
NAMES = ("left", "right", "left_laser", "right_laser")
CAMCHAIN = """\
cam0:
  T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  distortion_model: radtan
  intrinsics: [616.0, 616.0, 305.5, 255.5]
  resolution: [612, 512]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.003
cam1:
  T_cam_imu: [[1, 0, 0, -0.2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  T_cn_cnm1: [[1, 0, 0, -0.2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [616.0, 616.0, 305.5, 255.5]
  resolution: [612, 512]
  rostopic: /cam1/image_raw
"""
RIG = """\
camchain: camchain.yaml
laser: {rows: 11, columns: 11, fan_deg: 28.2, position_m: [0.0, 0.10, -0.06]}
"""
SIMULATED = """\
kind: simulated
camera: {width: 612, height: 512, focal_px: 616.0, baseline_m: 0.20}
laser: {rows: 11, columns: 11, fan_deg: 28.2, position_m: [0.0, 0.10, -0.06]}
world: {seed: 1}
"""
KEYS = {
    *("valid", "reasons", "dots", "matches", "points_m", "distance_m", "nearest_m", "normal", "edges", "tip"),
    *("heading_deg", "chord_m", "elapsed_ms"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("images")
    frames = draw_scene(SCENE).frames
    for name in NAMES:
        cv2.imwrite(str(path / f"{name}.png"), getattr(frames, name))
    (path / "rig.yaml").write_text(RIG)
    (path / "camchain.yaml").write_text(CAMCHAIN)
    (path / "simulated.yaml").write_text(SIMULATED)
    return path


def seen_in(
    images: Path, rig: Path | None, capsys: pytest.CaptureFixture[str], annotate: Path | None = None
) -> dict[str, object]:
    observe(images, rig, as_json=True, annotate=annotate)
    told: dict[str, object] = json.loads(capsys.readouterr().out)
    return told


def some_of(folder: Path, names: tuple[str, ...], to: Path) -> Path:
    to.mkdir()
    for name in names:
        (to / f"{name}.png").write_bytes((folder / f"{name}.png").read_bytes())
    return to


@pytest.mark.parametrize("rig", ["rig.yaml", "simulated.yaml"])
def test_four_images_and_a_rig_give_everything_that_can_be_measured(
    folder: Path, rig: str, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = seen_in(folder, folder / rig, capsys)
    assert seen.keys() >= KEYS
    assert seen["valid"] and seen["distance_m"] == pytest.approx(3.0, rel=0.01)
    assert len(seen["edges"]) == 2
    assert {"theta_deg", "rho_px", "sigma_theta_deg", "sigma_rho_px"} <= seen["edges"][0].keys()
    assert seen["tip"] is None and len(seen["points_m"]) == len(seen["sigma_m"]) > 20
    assert np.median(np.array(seen["points_m"])[:, 0]) == pytest.approx(3.0, rel=0.02)
    assert seen["normal"][0] < -0.9 and seen["chord_m"] == pytest.approx(0.9, rel=0.05)
    assert {"u", "v", "row", "column"} == seen["dots"]["left"][0].keys()
    for match in seen["matches"]:
        for side in ("left", "right"):
            dot = seen["dots"][side][match[side]]
            assert (dot["row"], dot["column"]) == (match["row"], match["column"])


@pytest.mark.parametrize(
    "names", [("left", "left_laser"), ("left_laser",), ("left_laser", "right_laser")], ids=lambda names: "+".join(names)
)
def test_fewer_images_still_give_distance_and_edges_where_the_rig_is_known(
    folder: Path, tmp_path: Path, names: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    whole = seen_in(folder, folder / "rig.yaml", capsys)
    seen = seen_in(some_of(folder, names, tmp_path / "some"), folder / "rig.yaml", capsys)
    assert seen.keys() >= KEYS
    assert seen["distance_m"] == pytest.approx(whole["distance_m"], rel=0.02)
    assert len(seen["dots"]["left"]) > 20 and len(seen["edges"]) == 2


def test_images_of_fisheyes_are_measured_as_well(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    straight = np.array([[616.0, 0, 305.5], [0, 616.0, 255.5], [0, 0, 1]])
    bends = np.array([0.02, -0.01, 0.0, 0.0])
    v, u = (grid.ravel() for grid in np.mgrid[0:512, 0:612].astype(float))
    from_where = cv2.fisheye.undistortPoints(np.column_stack([u, v])[:, None], straight, bends, P=straight)
    from_where = from_where.reshape(512, 612, 2).astype(np.float32)
    for name in NAMES:
        image = cv2.imread(str(folder / f"{name}.png"))
        bent = cv2.remap(image, from_where, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        cv2.imwrite(str(tmp_path / f"{name}.png"), bent)
    (tmp_path / "rig.yaml").write_text(RIG)
    fisheye = "distortion_coeffs: [0.02, -0.01, 0, 0]\n  distortion_model: equidistant\n"
    chain = CAMCHAIN.replace("distortion_coeffs: [0.0, 0.0, 0.0, 0.0]\n  distortion_model: radtan\n", fisheye)
    (tmp_path / "camchain.yaml").write_text(chain.replace("distortion_coeffs: []\n  distortion_model: none\n", fisheye))
    plain = seen_in(folder, folder / "rig.yaml", capsys)
    seen = seen_in(tmp_path, tmp_path / "rig.yaml", capsys)
    assert seen["valid"] and seen["distance_m"] == pytest.approx(3.0, rel=0.01)
    assert abs(len(seen["matches"]) - len(plain["matches"])) <= 8
    assert seen["chord_m"] == pytest.approx(0.9, rel=0.03)
    assert seen["heading_deg"] == pytest.approx(plain["heading_deg"], abs=1.0)


def test_one_photograph_needs_no_rig_and_has_no_distance(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    seen = seen_in(folder / "left_laser.png", None, capsys)
    assert len(seen["dots"]["left"]) > 20 and seen["distance_m"] is None and seen["dots"]["right"] == []
    both = seen_in(folder, folder / "rig.yaml", capsys)
    for edge in seen["edges"]:
        assert min(abs(edge["rho_px"] - other["rho_px"]) for other in both["edges"]) < 1.0
    places = {(round(dot["u"]), round(dot["v"])) for dot in both["dots"]["left"]}
    near = [any(abs(dot["u"] - u) + abs(dot["v"] - v) < 2 for u, v in places) for dot in seen["dots"]["left"]]
    assert np.mean(near) > 0.95


def test_the_same_images_tell_the_same_bit_for_bit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for images, rig in ((folder, folder / "rig.yaml"), (folder / "left_laser.png", None)):
        one, two = (seen_in(images, rig, capsys) for _ in range(2))
        assert one.pop("elapsed_ms").keys() == two.pop("elapsed_ms").keys()
        assert one == two


@pytest.mark.parametrize("kind", ["grey", "grey_in_colour", "alpha", "deep", "twelve_bits", "jpeg", "one_is_grey"])
def test_images_may_be_stored_in_any_usual_way(
    folder: Path, tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in NAMES:
        image = cv2.imread(str(folder / f"{name}.png"))
        assert image is not None
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        stored = {
            "grey": grey,
            "grey_in_colour": cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR),
            "alpha": cv2.cvtColor(image, cv2.COLOR_BGR2BGRA),
            "deep": image.astype(np.uint16) * 257,
            "twelve_bits": image.astype(np.uint16) * 16,
            "jpeg": image,
            "one_is_grey": grey if name == "right" else image,
        }[kind]
        quality = [cv2.IMWRITE_JPEG_QUALITY, 95] if kind == "jpeg" else []
        cv2.imwrite(str(tmp_path / f"{name}.{'jpg' if kind == 'jpeg' else 'png'}"), stored, quality)
    seen = seen_in(tmp_path, folder / "rig.yaml", capsys)
    assert seen["valid"] and seen["distance_m"] == pytest.approx(3.0, rel=0.015)


def test_the_annotated_picture_is_the_image_with_what_was_seen(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = seen_in(folder, folder / "rig.yaml", capsys, tmp_path / "seen.png")
    drawn, image = cv2.imread(str(tmp_path / "seen.png")), cv2.imread(str(folder / "left_laser.png"))
    assert drawn is not None and image is not None and drawn.shape[1] >= 600
    changed = np.abs(cv2.resize(drawn, image.shape[1::-1]).astype(int) - image).max(axis=2) > 40
    for dot in seen["dots"]["left"]:
        u, v = round(dot["u"]), round(dot["v"])
        assert changed[max(v - 7, 0) : v + 8, max(u - 7, 0) : u + 8].any()


def test_a_wall_of_one_grey_is_refused_in_words_with_all_keys(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "wall.png"), np.full((200, 240), 128, np.uint8))
    seen = seen_in(tmp_path / "wall.png", None, capsys)
    assert seen.keys() >= KEYS and not seen["valid"] and seen["reasons"] and seen["edges"] == []
    observe(tmp_path / "wall.png", None, as_json=False, annotate=None)
    assert capsys.readouterr().out.startswith("refused: 0 dots; ")


@pytest.mark.parametrize(
    ("images", "rig", "says"),
    [
        ("nowhere", "rig.yaml", "no such folder or image"),
        ("empty", "rig.yaml", "holds no left_laser.png"),
        ("rig.yaml", None, "not an image"),
        ("hollow.png", None, "not an image"),
        ("speck.png", None, "3 × 2 pixels are too few"),
        ("mixed", None, "the others are 612 × 512"),
        ("left.png", "small.yaml", "640 × 480"),
        ("large.png", "rig.yaml", "1224 × 1024 pixels, the rig's camera has 612 × 512; give them as the camera took"),
        ("left.png", "blind.yaml", "names no camera .* say camchain: "),
        ("left.png", "lost.yaml", "elsewhere.yaml: no such file"),
        ("left.png", "fisheye.yaml", "fisheye_chain.yaml:6: distortion_model of cam0: 'fov' is not known"),
        ("left.png", "nothing.yaml", "nothing.yaml"),
        ("left.png", "typing.yaml", "typing.yaml:2:.*fan"),
        ("left.png", "short.yaml", "short.yaml:2:.*position_m has 2 values, too few"),
        ("left.png", "twice.yaml", "twice.yaml:3:.*'laser' is already given at line 2"),
        ("left.png", "lazer.yaml", "lazer.yaml:2:.*no 'lazer' .*did you mean laser"),
        ("left.png", "metres.yaml", "metres.yaml:2:.*position_m.1: must be less than or equal to 5, not 100"),
    ],
)
def test_what_is_wrong_is_one_clear_line(folder: Path, images: str, rig: str | None, says: str) -> None:
    (folder / "small.yaml").write_text(SIMULATED.replace("612", "640").replace("512", "480"))
    (folder / "blind.yaml").write_text("kind: hardware\n")
    (folder / "lost.yaml").write_text("camchain: elsewhere.yaml\n")
    (folder / "fisheye.yaml").write_text("camchain: fisheye_chain.yaml\n")
    (folder / "fisheye_chain.yaml").write_text(CAMCHAIN.replace("radtan", "fov"))
    (folder / "typing.yaml").write_text(RIG.replace("28.2", "wide"))
    (folder / "short.yaml").write_text(RIG.replace("0.10, -0.06", "0.10"))
    (folder / "twice.yaml").write_text(RIG + RIG.splitlines()[1])
    (folder / "lazer.yaml").write_text(RIG.replace("laser:", "lazer:"))
    (folder / "metres.yaml").write_text(RIG.replace("0.10", "100"))
    (folder / "hollow.png").write_bytes(b"")
    (folder / "empty").mkdir(exist_ok=True)
    (folder / "mixed").mkdir(exist_ok=True)
    cv2.imwrite(str(folder / "speck.png"), np.zeros((2, 3), np.uint8))
    cv2.imwrite(str(folder / "large.png"), np.zeros((1024, 1224), np.uint8))
    cv2.imwrite(str(folder / "mixed" / "left_laser.png"), np.zeros((100, 100), np.uint8))
    cv2.imwrite(str(folder / "mixed" / "left.png"), np.zeros((512, 612), np.uint8))
    with pytest.raises((CommandError, ValueError), match=says) as error:
        observe(folder / images, None if rig is None else folder / rig, as_json=False, annotate=None)
    assert "\n" not in str(error.value)


def test_the_program_ends_with_2_and_one_line_where_it_cannot_look(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "torn.png").write_bytes((folder / "left_laser.png").read_bytes()[:9000])
    for arguments in (
        [str(tmp_path / "none")],
        [str(tmp_path / "torn.png")],
        [str(folder), "--annotate", str(tmp_path / "gone" / "seen.png")],
        [str(folder), "--annotate", str(tmp_path / "seen.doc")],
        [str(folder), "--rig", str(tmp_path / "none.yaml")],
    ):
        ran = subprocess.run(
            [sys.executable, "-m", "mission.cli.main", "observe", *arguments],
            capture_output=True,
            text=True,
            check=False,
        )
        assert ran.returncode == 2 and ran.stdout == "" and ran.stderr.count("\n") == 1, ran
