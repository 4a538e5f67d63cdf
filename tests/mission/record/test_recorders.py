"""Recording never raises in flight, never waits for a disk, and says what it lost."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from devices.torn_files import csv_rows
from mission.record.folder import create
from mission.record.frames import QUEUE, FrameRecorder
from mission.record.row_file import RowFile
from mission.record.telemetry import TelemetryRecorder
from tests.mission.record.synthetic_run import CAMERA, MISSION, estimate, flown, fly, images, telemetry


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_loses_lines_is_told_once_and_never_raises() -> None:
    told: list[str] = []
    file = RowFile(Path("/dev/full"), on_lost=told.append)
    for number in range(3):
        file.row((number, 1.5))
    file.close()
    assert file.lost >= 3
    assert len(told) == 1


def test_what_a_number_cannot_say_is_empty_in_rows_and_null_in_json(tmp_path: Path) -> None:
    file = RowFile(tmp_path / "x")
    file.row((1.0, None, float("nan"), True, np.float64(2.5), "OFFBOARD"))
    file.json({"a": float("inf"), "b": np.array([1.0, np.nan]), "c": (np.int64(3), None)})
    file.close()
    first, second = (tmp_path / "x").read_text().splitlines()
    assert first == "1.0000,,,1,2.5000,OFFBOARD"
    assert json.loads(second) == {"a": None, "b": [1.0, None], "c": [3, None]}


def test_every_line_is_on_its_way_to_the_disk_before_the_next(tmp_path: Path) -> None:
    """A killed run keeps what it had written: the file is read while it is still open."""
    recorder = TelemetryRecorder(tmp_path / "t.csv")
    for second in range(5):
        recorder.record(float(second), telemetry(12.0, -30.0), None)
        rows = csv_rows(tmp_path / "t.csv")
        assert float(rows[-1]["t"]) == second
    assert rows[-1]["north"] == "12.0000"
    assert rows[-1]["mode"] == "OFFBOARD"
    assert rows[-1]["set_north"] == ""
    recorder.close()


def test_a_disk_that_hangs_costs_photographs_and_not_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    released = threading.Event()
    write = FrameRecorder._write

    def hang(self: FrameRecorder, job: Any) -> None:
        released.wait()
        write(self, job)

    monkeypatch.setattr(FrameRecorder, "_write", hang)
    recorder = FrameRecorder(tmp_path, CAMERA)
    for number in range(3 * QUEUE):
        recorder.record(images(float(number)), "leading", estimate(number, number, 3.0), True, 0.9)
    assert recorder.written == 0
    assert 2 * QUEUE - 1 <= recorder.dropped <= 2 * QUEUE
    released.set()
    recorder.close()
    lines = [json.loads(line) for line in (tmp_path / "frames.jsonl").read_text().splitlines()]
    assert len(lines) == recorder.written == 3 * QUEUE - recorder.dropped
    assert all((tmp_path / line["file"]).is_file() for line in lines)


def test_a_photograph_is_taken_for_every_stretch_of_blade_and_no_more(tmp_path: Path) -> None:
    recorder = FrameRecorder(tmp_path, CAMERA, inline=True, spacing_m=0.5)
    stations = np.arange(0.0, 10.0, 0.1)
    taken = [
        station
        for station in stations
        if recorder.record(images(station), "leading", estimate(station, station, 3.0), True, 0.9)
    ]
    recorder.close()
    assert np.all(np.diff(taken) < 0.61)
    assert np.all(np.diff(taken) > 0.49)


def test_a_refused_photograph_does_not_stand_for_its_stretch(tmp_path: Path) -> None:
    recorder = FrameRecorder(tmp_path, CAMERA, inline=True)
    assert recorder.record(images(0.0), "leading", estimate(0.0, 5.0, 3.0), False, 0.9)
    assert recorder.record(images(0.2), "leading", estimate(0.2, 5.0, 3.0), True, 0.9)
    assert not recorder.record(images(0.4), "leading", estimate(0.4, 5.0, 3.0), True, 0.9)
    recorder.close()


def test_photographs_that_the_disk_refuses_are_counted_and_leave_no_halves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: Path, data: bytes) -> int:
        self.touch()
        raise OSError(28, "No space left on device")

    recorder = FrameRecorder(tmp_path, CAMERA, inline=True)
    monkeypatch.setattr(Path, "write_bytes", full)
    recorder.record(images(0.0), "leading", estimate(0.0, 5.0, 3.0), True, 0.9)
    recorder.close()
    assert (recorder.written, recorder.lost) == (0, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["frames.jsonl"]


def test_two_recordings_of_one_flight_are_the_same_byte_for_byte(tmp_path: Path) -> None:
    folders = [create(tmp_path, "twice", MISSION) for _ in range(2)]
    for folder in folders:
        fly(folder, until_s=70.0)
    first, second = (
        {
            path.relative_to(folder.path): path.read_bytes()
            for path in sorted(folder.path.rglob("*"))
            if path.is_file() and path != folder.log
        }
        for folder in folders
    )
    assert first == second
    assert len(first) > 40


def test_the_photographs_of_a_pass_lie_close_enough_to_show_every_metre(tmp_path: Path) -> None:
    folder = flown(tmp_path)
    lines = [json.loads(line) for line in (folder.frames / "frames.jsonl").read_text().splitlines()]
    for side in ("leading", "trailing"):
        stations = np.array([line["station_m"] for line in lines if line["side"] == side])
        assert np.abs(np.diff(stations)).max() < 0.6
