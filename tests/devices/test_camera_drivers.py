"""Real rigs: the one that has no cameras, and two cameras that OpenCV opens."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from devices.camera_drivers import DRIVERS, open_rig
from devices.rig import CaptureError
from mission.executive.belief import rig_geometry
from mission.language.rig_file import RigFile
from vision.camera import RigGeometry

SIZE = (96, 64)


def geometry(width: int = SIZE[0]) -> RigGeometry:
    camera = {"width": width, "height": SIZE[1], "focal_px": 100.0, "baseline_m": 0.2}
    rig = RigFile.model_validate({"kind": "hardware", "system": "udpin://0.0.0.0:1", "camera": camera})
    return rig_geometry(rig, Path())


def film(path: Path, *greys: int) -> str:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, SIZE)
    for grey in greys:
        writer.write(np.full((SIZE[1], SIZE[0], 3), grey, np.uint8))
    writer.release()
    return str(path)


def test_a_rig_without_cameras_says_so() -> None:
    rig = open_rig("none", geometry(), (), lambda: 0.0)
    for laser in (True, False):
        with pytest.raises(CaptureError, match="this rig has no cameras"):
            rig.capture(laser)
    assert not rig.simulated
    rig.close()


def test_a_rig_file_without_cameras_needs_no_camera_geometry() -> None:
    rig = RigFile.model_validate({"kind": "hardware", "system": "udpin://0.0.0.0:1", "camera_driver": "none"})
    assert rig_geometry(rig, Path()).laser is None


def test_two_cameras_are_left_and_right_with_the_laser_off(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    sources = [film(tmp_path / "left.avi", 40, 60), film(tmp_path / "right.avi", 200, 220)]
    rig = open_rig("opencv", geometry(), sources, lambda: 7.5)
    assert "no laser switch" in caplog.text
    first, second = rig.capture(), rig.capture(laser=False)
    for frames, left, right in ((first, 40, 200), (second, 60, 220)):
        assert frames.left is not None and frames.right is not None
        assert frames.left.shape[:2] == (SIZE[1], SIZE[0])
        assert abs(float(frames.left.mean()) - left) < 6
        assert abs(float(frames.right.mean()) - right) < 6
        assert (frames.left_laser, frames.right_laser, frames.pose) == (None, None, None)
        assert frames.stamp_s == 7.5
    with pytest.raises(CaptureError, match="delivers no picture"):
        rig.capture()
    rig.close()
    rig.close()
    with pytest.raises(CaptureError, match="closed"):
        rig.capture()


def test_a_camera_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match=r"nowhere\.avi.*cannot be opened"):
        open_rig("opencv", geometry(), [str(tmp_path / "nowhere.avi")] * 2, lambda: 0.0)


def test_pictures_of_another_size_than_the_rig_file_s_are_refused(tmp_path: Path) -> None:
    sources = [film(tmp_path / "left.avi", 40), film(tmp_path / "right.avi", 40)]
    with pytest.raises(CaptureError, match="delivers 96 × 64 px, the rig file says 128 × 64"):
        open_rig("opencv", geometry(128), sources, lambda: 0.0).capture()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"camera_driver": "pigeon"}, f"choose one of {', '.join(DRIVERS)}"),
        ({"camera_driver": "opencv", "sources": [0]}, "two cameras"),
        ({"sources": [0, 2]}, "two cameras"),
        ({"kind": "px4_sitl", "camera_driver": "none"}, "kind hardware"),
    ],
)
def test_a_rig_file_that_contradicts_itself_is_refused(more: dict[str, object], said: str) -> None:
    camera = {"width": 96, "height": 64, "focal_px": 100.0, "baseline_m": 0.2}
    with pytest.raises(ValueError, match=said):
        RigFile.model_validate({"kind": "hardware", "system": "udpin://0.0.0.0:1", "camera": camera, **more})
