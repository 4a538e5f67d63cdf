"""Stored images play back as a rig would deliver them."""

import json

import cv2
import numpy as np
import pytest

from devices.recorded_rig import RecordedRig
from devices.rig import CaptureError
from vision.camera import Camera, RigGeometry, StereoPair

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
GEOMETRY = RigGeometry(StereoPair(CAMERA, CAMERA))


def picture(value: int) -> np.ndarray:
    return np.full((48, 64, 3), value, np.uint8)


def test_a_folder_of_four_images_is_one_set(tmp_path):
    for value, view in enumerate(("left", "right", "left_laser", "right_laser")):
        cv2.imwrite(str(tmp_path / f"{view}.png"), picture(10 * value))
    rig = RecordedRig(tmp_path, GEOMETRY, now=lambda: 7.5)
    frames = rig.capture()
    assert frames.stamp_s == 7.5
    values = [image[0, 0, 0] for image in (frames.left, frames.right, frames.left_laser, frames.right_laser)]
    assert values == [0, 10, 20, 30]
    assert frames.pose is None
    with pytest.raises(CaptureError, match="ended after 1"):
        rig.capture()


def test_folders_of_sets_play_in_the_order_of_their_names_and_again_when_asked(tmp_path):
    for name, value in (("b", 2), ("a", 1)):
        (tmp_path / name).mkdir()
        cv2.imwrite(str(tmp_path / name / "left_laser.png"), picture(value))
    rig = RecordedRig(tmp_path, GEOMETRY, repeat=True)
    played = [rig.capture() for _ in range(3)]
    assert [frames.left_laser[0, 0, 0] for frames in played] == [1, 2, 1]
    assert all(frames.left is None and frames.right is None for frames in played)


def test_frames_of_a_run_keep_their_stamps_and_poses(tmp_path):
    lines = []
    for number in (1, 2):
        cv2.imwrite(str(tmp_path / f"{number:05d}_left.png"), picture(number))
        cv2.imwrite(str(tmp_path / f"{number:05d}_left_laser.png"), picture(100 + number))
        pose = {"position": [number, 0.0, -50.0], "rotation": np.eye(3).tolist()}
        lines.append(json.dumps({"file": f"{number:05d}_left.png", "stamp_s": 10.0 * number, "pose": pose}))
    (tmp_path / "frames.jsonl").write_text("\n".join(lines) + '\n{"file": "torn')
    rig = RecordedRig(tmp_path, GEOMETRY)
    assert [rig.capture().stamp_s for _ in range(2)] == [10.0, 20.0]
    assert rig.sets[1].pose is not None and rig.sets[1].pose.position[0] == 2


def test_without_the_laser_no_laser_images_are_played(tmp_path):
    for view in ("left", "left_laser"):
        cv2.imwrite(str(tmp_path / f"{view}.png"), picture(1))
    rig = RecordedRig(tmp_path, GEOMETRY, repeat=True)
    assert rig.capture(laser=False).left_laser is None
    rig.set_laser(False)
    with pytest.raises(CaptureError, match="laser"):
        rig.capture()


@pytest.mark.parametrize("content", ["nothing", "missing", "broken"])
def test_what_cannot_be_played_is_said_in_one_line(tmp_path, content):
    folder = tmp_path / "images"
    if content != "missing":
        folder.mkdir()
    if content == "broken":
        (folder / "left.png").write_bytes(b"no image")
    with pytest.raises(CaptureError) as caught:
        RecordedRig(folder, GEOMETRY).capture()
    assert "images" in str(caught.value) and "\n" not in str(caught.value)
