"""A run's folder is made whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections import namedtuple
from pathlib import Path

import pytest

from mission.record.folder import RunFolderError, create, open_run

Usage = namedtuple("Usage", "total used free")


def test_a_new_run_has_its_mission_and_its_rooms(tmp_path: Path) -> None:
    folder = create(tmp_path / "logs", "v80_blade", "mission: v80_blade\n")
    assert folder.mission.read_text() == "mission: v80_blade\n"
    assert folder.frames.is_dir()
    assert folder.telemetry.is_dir()
    assert folder.name.endswith("Z-v80_blade")


def test_runs_that_start_in_the_same_second_do_not_share_a_folder(tmp_path: Path) -> None:
    folders = {create(tmp_path, "a", "").path for _ in range(5)}
    assert len(folders) == 5


@pytest.mark.parametrize("name", ["../../etc", "a/b", "sp ace", "", "\x1b[31m"])
def test_a_mission_s_name_cannot_lead_out_of_the_logs_folder(tmp_path: Path, name: str) -> None:
    folder = create(tmp_path / "logs", name, "")
    assert folder.path.parent == tmp_path / "logs"
    assert folder.path.name.isprintable()


def test_a_nearly_full_disk_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(100 << 30, 100 << 30, 5 << 20))
    with pytest.raises(RunFolderError, match=r"5 MB free.*--record"):
        create(tmp_path / "logs", "a", "")
    assert not (tmp_path / "logs").exists()


def test_a_disk_that_fills_up_while_the_folder_is_made_leaves_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RunFolderError, match="the disk is full"):
        create(tmp_path, "a", "mission: a\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("logs", ["/proc/logs", "/dev/null/logs"])
def test_a_place_that_cannot_be_written_is_one_line(logs: str) -> None:
    with pytest.raises(RunFolderError, match=r"--record DIR") as caught:
        create(Path(logs), "a", "")
    assert "\n" not in str(caught.value)


def test_a_run_is_found_by_path_by_name_and_as_the_latest(tmp_path: Path) -> None:
    first, last = create(tmp_path, "a", ""), create(tmp_path, "b", "")
    first.path.rename(tmp_path / "20200101T000000Z-a")
    assert open_run(last.path, tmp_path).path == last.path
    assert open_run(Path(last.name), tmp_path).path == last.path
    assert open_run(Path("latest"), tmp_path).path == last.path


def test_a_folder_that_is_no_run_is_told_apart_from_one_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="no such run"):
        open_run(tmp_path / "nothing", tmp_path)
    with pytest.raises(RunFolderError, match=r"no mission\.yaml"):
        open_run(tmp_path, tmp_path)
    with pytest.raises(RunFolderError, match="no run in this folder yet"):
        open_run(Path("latest"), tmp_path)
