"""`mission report`: the figures and the page again, from what a run recorded."""

from __future__ import annotations

import json
from pathlib import Path

from mission.record.folder import create
from tests.mission.cli.conftest import Call
from tests.mission.record.synthetic_run import MISSION, flown, fly, write_journal


def test_the_figures_of_a_completed_run(call: Call, tmp_path: Path) -> None:
    folder = flown(tmp_path)
    said = call("report", folder.path)
    assert said.code == 0
    assert said.out.startswith("completed  v80_blade  200 s of flight")
    for words in ("3 m ± 0.10 m", "leading 100 %", "at 39.80 m", str(folder.report)):
        assert words in said.out, said.out


def test_deleted_figures_come_back_the_same(call: Call, tmp_path: Path) -> None:
    folder = flown(tmp_path)
    first = call("report", "latest", "--logs", tmp_path, "--json").out
    folder.summary.unlink()
    folder.report.unlink()
    assert call("report", folder.name, "--logs", tmp_path, "--json").out == first
    assert json.loads(folder.summary.read_text()) == json.loads(first)
    assert folder.report.is_file()


def test_a_killed_run_says_how_to_go_on(call: Call, tmp_path: Path) -> None:
    folder = create(tmp_path, "v80_blade", MISSION)
    fly(folder, until_s=70.0)
    write_journal(folder, until_s=65.0)
    said = call("report", folder.path)
    assert said.code == 0
    assert said.out.startswith("unfinished")
    assert f"mission run --resume {folder.path}" in said.out


def test_what_is_no_run_is_one_line(call: Call, tmp_path: Path) -> None:
    call("report", tmp_path / "nothing").assert_one_line(2)
    call("report", tmp_path).assert_one_line(2)
    call("report", "latest", "--logs", tmp_path).assert_one_line(2)
