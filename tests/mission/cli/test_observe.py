"""`mission observe`: stored images in, what was seen out."""

import json
from pathlib import Path

import cv2
import pytest

from devices.scenes import SceneSettings, draw_scene
from mission.cli.errors import CommandError
from mission.cli.observe import observe

SCENE = SceneSettings(seed=3, distance_m=3.0, chord_m=0.9, angle=0.6)
RIG = """\
kind: simulated
camera: {width: 612, height: 512, focal_px: 616.0, baseline_m: 0.20}
laser: {rows: 11, columns: 11, fan_deg: 28.2, position_m: [0.0, 0.10, -0.06]}
world: {seed: 1}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("images")
    frames = draw_scene(SCENE).frames
    for name in ("left", "right", "left_laser", "right_laser"):
        cv2.imwrite(str(path / f"{name}.png"), getattr(frames, name))
    (path / "rig.yaml").write_text(RIG)
    return path


def test_four_images_and_a_rig_give_distance_edges_and_an_annotated_picture(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    observe(folder, folder / "rig.yaml", as_json=True, annotate=tmp_path / "seen.png")
    seen = json.loads(capsys.readouterr().out)
    assert seen["valid"] and seen["distance_m"] == pytest.approx(3.0, rel=0.01)
    assert len(seen["edges"]) == 2 and {"theta_deg", "rho_px", "sigma_theta_deg"} <= seen["edges"][0].keys()
    assert {"u", "v", "row", "column"} == seen["dots"]["left"][0].keys()
    assert seen["tip"] is None and len(seen["points_m"]) == len(seen["sigma_m"]) > 20
    drawn = cv2.imread(str(tmp_path / "seen.png"))
    assert drawn is not None and drawn.shape[1] >= 600


def test_one_photograph_needs_no_rig_and_has_no_distance(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    observe(folder / "left_laser.png", None, as_json=True, annotate=None)
    seen = json.loads(capsys.readouterr().out)
    assert len(seen["dots"]["left"]) > 10 and seen["distance_m"] is None and seen["dots"]["right"] == []


@pytest.mark.parametrize(
    ("images", "rig", "says"),
    [
        ("nowhere", "rig.yaml", "no such folder or image"),
        ("rig.yaml", None, "not an image"),
        ("left.png", "small.yaml", "640 × 480"),
        ("left.png", "blind.yaml", "names no camera"),
    ],
)
def test_what_is_wrong_is_one_clear_line(folder: Path, images: str, rig: str | None, says: str) -> None:
    (folder / "small.yaml").write_text(RIG.replace("612", "640").replace("512", "480"))
    (folder / "blind.yaml").write_text("kind: hardware\n")
    with pytest.raises(CommandError, match=says) as error:
        observe(folder / images, None if rig is None else folder / rig, as_json=False, annotate=None)
    assert "\n" not in str(error.value)
