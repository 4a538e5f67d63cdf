"""A rig that plays back stored images: sets of four files, or the frames that a run left behind."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from devices.rig import CaptureError
from vision.camera import RigGeometry
from vision.capture import CameraPose, Image, StereoFrames

VIEWS = ("left", "right", "left_laser", "right_laser")
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
_NUMBERED = re.compile(r"(.+)_(left|right|left_laser|right_laser)")


@dataclass(frozen=True)
class RecordedSet:
    """Files of one instant by view, and when and from where they were taken, where the recording says so."""

    files: dict[str, Path]
    stamp_s: float | None = None
    pose: CameraPose | None = None


class RecordedRig:
    """Stored images as a rig. Implements `devices.rig.Rig`.

    folder: one set (`left.png`, `right.png`, `left_laser.png`, `right_laser.png` or fewer), a folder of such folders
    played in the order of their names, or a run's `frames/` (`00001_left.jpg`, …). now: the clock that stamps what is
    played; by default a set keeps its recorded stamp, or its number where it has none. repeat: begin again after the
    last set.

    Raises:
        CaptureError: nothing in the folder can be played; one line for a person.
    """

    simulated = True

    def __init__(
        self, folder: Path, geometry: RigGeometry, now: Callable[[], float] | None = None, repeat: bool = False
    ) -> None:
        self.geometry = geometry
        self.sets = recorded_sets(folder)
        self._now = now
        self._repeat = repeat
        self._next = 0
        self._laser_armed = True
        self._lock = threading.Lock()

    def capture(self, laser: bool = True) -> StereoFrames:
        """The next set; CaptureError after the last one, or when a file cannot be read."""
        with self._lock:
            if laser and not self._laser_armed:
                raise CaptureError("the laser is not armed")
            if self._next >= len(self.sets):
                if not self._repeat:
                    raise CaptureError(f"the recording has ended after {len(self.sets)} sets of images")
                self._next = 0
            number, one = self._next, self.sets[self._next]
            self._next += 1
        stamp = float(number) if one.stamp_s is None else one.stamp_s
        wanted = VIEWS if laser else VIEWS[:2]
        left, right, left_laser, right_laser = (
            _image(one.files[view]) if view in wanted and view in one.files else None for view in VIEWS
        )
        return StereoFrames(stamp if self._now is None else self._now(), left, right, left_laser, right_laser)

    def set_laser(self, on: bool) -> None:
        """Arm or disarm the laser: disarmed, only sets without laser are played."""
        with self._lock:
            self._laser_armed = on

    def close(self) -> None:
        """Nothing to release."""
        self.set_laser(False)


def recorded_sets(folder: Path) -> tuple[RecordedSet, ...]:
    """The sets of a folder in the order in which they are played.

    Raises:
        CaptureError: the folder is missing or holds none.
    """
    if not folder.is_dir():
        raise CaptureError(f"{folder}: no such folder of recorded images")
    single = _set(folder)
    if single is not None:
        return (single,)
    found = tuple(_frames_of_a_run(folder))
    if not found:
        found = tuple(one for path in sorted(folder.iterdir()) if path.is_dir() and (one := _set(path)) is not None)
    if not found:
        raise CaptureError(f"{folder}: no images here: expected left.png, right.png, left_laser.png, right_laser.png")
    return found


def _set(folder: Path) -> RecordedSet | None:
    files = {
        view: path for view in VIEWS for suffix in reversed(SUFFIXES) if (path := folder / f"{view}{suffix}").is_file()
    }
    return RecordedSet(files) if files else None


def _frames_of_a_run(folder: Path) -> Iterator[RecordedSet]:
    files: dict[str, dict[str, Path]] = {}
    for path in sorted(folder.iterdir()):
        match = _NUMBERED.fullmatch(path.stem)
        if match and path.suffix.lower() in SUFFIXES:
            files.setdefault(match[1], {})[match[2]] = path
    told = _told(folder / "frames.jsonl")
    for number in sorted(files):
        line = next((told[path.name] for path in files[number].values() if path.name in told), {})
        pose = line.get("pose")
        yield RecordedSet(
            files[number],
            line.get("stamp_s"),
            CameraPose(np.array(pose["position"], float), np.array(pose["rotation"], float)) if pose else None,
        )


def _told(path: Path) -> dict[str, dict[str, Any]]:
    """Lines of frames.jsonl by the file they tell of; torn lines are left out."""
    if not path.is_file():
        return {}
    lines: dict[str, dict[str, Any]] = {}
    for text in path.read_text("utf-8", errors="replace").splitlines():
        try:
            line = json.loads(text)
        except ValueError:
            continue
        if isinstance(line, dict) and "file" in line:
            lines[str(line["file"])] = line
    return lines


def _image(path: Path) -> Image:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise CaptureError(f"{path}: not an image that can be read")
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    if image.ndim == 3:
        image = image[..., :3] if image.shape[2] >= 3 else image[..., 0]
    return np.ascontiguousarray(image, np.uint8)
