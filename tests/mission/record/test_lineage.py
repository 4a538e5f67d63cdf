"""Runs that go on with one another are one inspection: nothing of the earlier ones is lost, nothing counts twice."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from mission.cli.errors import CommandError
from mission.cli.going_on import interrupted_run
from mission.cli.report import rebuild, told
from mission.record.folder import RunFolder, create
from mission.record.history import RunHistory
from mission.record.lineage import NOTE, RunNote, last_of_row, lineage, note_of, reference
from mission.record.summary import summarise
from tests.mission.record.synthetic_run import MISSION, flown, fly, write_journal

CUTS_S = (85.0, 130.0)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[RunFolder]:
    """One inspection in three programs: killed while leading, and again while trailing."""
    logs = tmp_path_factory.mktemp("logs")
    found: list[RunFolder] = []
    for number, (from_s, until_s) in enumerate(((60.0, CUTS_S[0]), CUTS_S, (CUTS_S[1], 160.0))):
        folder = create(logs, "v80_blade", MISSION)
        fly(folder, from_s=from_s, until_s=until_s)
        if number:
            RunNote(continues=reference(found[-1], folder)).write(folder)
            write_journal(folder, from_s, goes_on_in="inspect.leading" if number == 1 else "inspect.trailing")
        else:
            write_journal(folder)
        lines = [line for line in folder.journal.read_text().splitlines() if json.loads(line)["t"] <= until_s]
        if number < 2:
            folder.journal.write_text("\n".join(lines) + "\n")
        found.append(folder)
    return found


def test_three_programs_tell_the_same_inspection_as_one(runs: list[RunFolder], tmp_path: Path) -> None:
    whole = summarise(RunHistory(flown(tmp_path)))
    joined = summarise(RunHistory(runs[-1]))
    assert joined["continues"] == [run.name for run in runs[:-1]]
    assert (joined["outcome"], joined["final_state"]) == ("completed", "completed")
    assert joined["coverage"] == pytest.approx(whole["coverage"], abs=0.01)
    assert joined["vision"]["cycles"] == whole["vision"]["cycles"]
    assert joined["standoff"] == whole["standoff"]
    assert joined["tip"] == whole["tip"] and joined["root"] == whole["root"]
    assert joined["duration_s"] == pytest.approx(whole["duration_s"], abs=0.5)
    assert joined["setpoints"]["longest_gap_ms"] == pytest.approx(40.0), "the time without a program is no gap of one"


def test_what_was_cut_off_says_so(runs: list[RunFolder]) -> None:
    states = [(state["state"], state["by"]) for state in summarise(RunHistory(runs[-1]))["states"]]
    assert states.count(("inspect.leading", "interrupted")) == 1
    assert states.count(("inspect.trailing", "interrupted")) == 1
    assert ("inspect.trailing", "root_detected") in states


def test_each_run_of_a_row_tells_what_was_known_by_then(runs: list[RunFolder]) -> None:
    first, second, third = (summarise(RunHistory(run)) for run in runs)
    assert first["outcome"] == second["outcome"] == "unfinished"
    assert first["frames"] < second["frames"] < third["frames"]
    assert "trailing" not in first["coverage"]


def test_the_page_shows_photographs_of_every_run(runs: list[RunFolder]) -> None:
    summary = rebuild(runs[-1])
    page = runs[-1].report.read_text()
    assert f"../{runs[0].name}/frames/" in page and "interrupted; all of it is told here" in page
    assert any("goes on" in line for line in told(runs[-1], summary))


def test_only_the_last_of_a_row_is_gone_on_with(runs: list[RunFolder]) -> None:
    assert [last_of_row(run) for run in runs] == [RunFolder(runs[2].path)] * 3
    with pytest.raises(CommandError, match=f"{runs[0].name} was gone on with already: give --resume {runs[2].name}"):
        interrupted_run(runs[0].path, runs[0].path.parent)
    assert interrupted_run(runs[2].path, runs[0].path.parent) == runs[2]


def test_a_run_that_did_nothing_is_not_the_last_of_a_row(tmp_path: Path) -> None:
    one, other = create(tmp_path, "a", MISSION), create(tmp_path, "b", MISSION)
    RunNote(continues=one.name).write(other)
    other.log.write_text('{"event": "run_created"}\n')
    assert last_of_row(one) == one


def test_a_run_that_was_removed_ends_the_row(runs: list[RunFolder], tmp_path: Path) -> None:
    for run in runs[1:]:
        shutil.copytree(run.path, tmp_path / run.name)
    last = RunFolder(tmp_path / runs[-1].name)
    assert [run.name for run in lineage(last)] == [run.name for run in runs[1:]]
    assert summarise(RunHistory(last))["outcome"] == "completed"


def test_runs_that_name_each_other_are_no_endless_row(tmp_path: Path) -> None:
    one, other = create(tmp_path, "a", MISSION), create(tmp_path, "b", MISSION)
    RunNote(continues=other.name).write(one)
    RunNote(continues=one.name).write(other)
    assert [run.name for run in lineage(one)] == [other.name, one.name]


@pytest.mark.parametrize("content", ["", "{", "[1]", '{"continues": 3}', "\0\0"])
def test_a_torn_note_leaves_a_run_of_its_own(tmp_path: Path, content: str) -> None:
    run = create(tmp_path, "a", MISSION)
    (run.path / NOTE).write_text(content)
    assert note_of(run) == RunNote() and lineage(run) == (run,)


def test_a_run_elsewhere_is_found_too(tmp_path: Path) -> None:
    one, other = create(tmp_path / "here", "a", MISSION), create(tmp_path / "there", "b", MISSION)
    RunNote(continues=reference(one, other)).write(other)
    assert [run.name for run in lineage(other)] == [one.name, other.name]
