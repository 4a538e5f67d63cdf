"""The photographs an inspector looks at: encoded and written beside the flight, never in its way."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mission.record.coverage import mm_per_px, visible_stretch
from mission.record.row_file import RowFile

if TYPE_CHECKING:
    from vision.camera import Camera
    from vision.capture import Image, StereoFrames
    from vision.estimate import BladeEstimate

QUEUE = 24
"""Frames that may wait for the disk: about 45 MB at 612 × 512; at full resolution a driver hands over fewer."""

JPEG_QUALITY = 92


@dataclass(frozen=True)
class _Job:
    images: tuple[tuple[Path, Image], ...]
    line: dict[str, Any]


class FrameRecorder:
    """Writes `frames/NNNNN_left.jpg`, `NNNNN_left_laser.jpg` and a line each in `frames/frames.jsonl`.

    With `inline` (lockstep time) everything is written at once and in order; otherwise a thread of its own does it, and
    a frame that finds the queue full is dropped and counted in `dropped`. `lost` counts what the disk refused. A frame
    is taken when the camera has moved `spacing_m` along the blade since the last good one of that side.
    """

    def __init__(
        self,
        folder: Path,
        camera: Camera,
        *,
        inline: bool = False,
        spacing_m: float = 0.3,
        on_lost: Callable[[str], None] | None = None,
    ) -> None:
        self.written = 0
        self.dropped = 0
        self.lost = 0
        self._folder, self._camera, self._spacing_m = folder, camera, spacing_m
        self._on_lost = on_lost
        self._number = 0
        self._last: tuple[str, float, float, bool] | None = None
        self._lines = RowFile(folder / "frames.jsonl", on_lost=on_lost)
        self._queue: queue.Queue[_Job | None] = queue.Queue(QUEUE)
        self._thread: threading.Thread | None = None
        if not inline:
            self._thread = threading.Thread(target=self._write_queued, name="frames", daemon=True)
            self._thread.start()

    def record(
        self, frames: StereoFrames, side: str, estimate: BladeEstimate | None, accepted: bool, sharpness: float
    ) -> bool:
        """Take these frames if they show something new; True when they will be written."""
        if frames.left is None or not self._due(frames.stamp_s, side, estimate, accepted):
            return False
        number = self._number + 1
        named = (("left", frames.left), ("left_laser", frames.left_laser))
        images = tuple((self._folder / f"{number:05d}_{name}.jpg", image) for name, image in named if image is not None)
        job = _Job(images, self._line(images, frames, side, estimate, accepted, sharpness))
        if self._thread is None:
            self._write(job)
        else:
            try:
                self._queue.put_nowait(job)
            except queue.Full:
                self.dropped += 1
                return False
        self._number = number
        self._last = (side, frames.stamp_s, estimate.station_m if estimate is not None else 0.0, accepted)
        return True

    def close(self, timeout_s: float = 20.0) -> None:
        """Write what waits, then stop; idempotent."""
        if self._thread is not None:
            self._queue.put(None)
            self._thread.join(timeout_s)
            self._thread = None
        self._lines.close()

    def _due(self, stamp_s: float, side: str, estimate: BladeEstimate | None, accepted: bool) -> bool:
        if self._last is None or self._last[0] != side:
            return True
        _, last_s, last_m, last_accepted = self._last
        if estimate is None or not accepted:
            return stamp_s - last_s >= 1.0
        return not last_accepted or abs(estimate.station_m - last_m) >= self._spacing_m

    def _line(
        self,
        images: tuple[tuple[Path, Image], ...],
        frames: StereoFrames,
        side: str,
        estimate: BladeEstimate | None,
        accepted: bool,
        sharpness: float,
    ) -> dict[str, Any]:
        files = {path.stem.partition("_")[2]: path.name for path, _ in images}
        pose = frames.pose
        return {
            "file": files["left"],
            "laser_file": files.get("left_laser"),
            "stamp_s": frames.stamp_s,
            "side": side,
            "station_m": estimate.station_m if estimate is not None else None,
            "distance_m": estimate.distance_m if estimate is not None else None,
            "mm_per_px": mm_per_px(estimate.distance_m, self._camera.fx) if estimate is not None else None,
            "edge_m": visible_stretch(estimate, side, self._camera) if estimate is not None else None,
            "sharpness": sharpness,
            "accepted": accepted,
            "pose": {"position": pose.position, "rotation": pose.rotation} if pose is not None else None,
        }

    def _write_queued(self) -> None:
        while (job := self._queue.get()) is not None:
            self._write(job)

    def _write(self, job: _Job) -> None:
        import cv2

        try:
            for path, image in job.images:
                encoded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
                path.write_bytes(encoded.tobytes())
        except (OSError, cv2.error) as error:
            self.lost += 1
            for path, _ in job.images:
                path.unlink(missing_ok=True)
            if self.lost == 1 and self._on_lost is not None:
                self._on_lost(str(error))
            return
        self._lines.json(job.line)
        self.written += 1
