"""The journal: on the disk before anything takes effect, readable after any crash, and never the end of a flight."""

from __future__ import annotations

import asyncio
import errno
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.executive.executive import Executive
from mission.executive.journal import Journal, JournalError, read_journal, reopen
from mission.executive.machine import Machine


def written(path: Path, lines: int = 3) -> Path:
    journal = Journal(path, sync=False)
    for number in range(lines):
        journal.append("event", number * 0.12345, event="done", data={"value": np.float64(number)})
    journal.close()
    return path


def test_lines_come_back_as_they_were_written(tmp_path: Path) -> None:
    entries = read_journal(written(tmp_path / "journal.jsonl"))
    assert [(entry.seq, entry.t, entry.kind) for entry in entries] == [
        (0, 0.0, "event"),
        (1, 0.123, "event"),
        (2, 0.247, "event"),
    ]
    assert entries[2].fields["data"] == {"value": 2.0}


def test_a_number_that_json_does_not_know_is_null(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl", sync=False)
    journal.append("event", 0.0, values=[float("nan"), float("inf"), np.array([1.0, np.nan])], text="Größe\n")
    journal.close()
    line = (tmp_path / "journal.jsonl").read_text()
    assert line.count("\n") == 1
    assert json.loads(line)["values"] == [None, None, [1.0, None]]


@given(cut=st.integers(0, 400))
def test_a_journal_torn_anywhere_is_read_up_to_its_last_whole_line_and_goes_on(
    tmp_path_factory: pytest.TempPathFactory, cut: int
) -> None:
    path = written(tmp_path_factory.mktemp("torn") / "journal.jsonl")
    content = path.read_bytes()[:cut]
    path.write_bytes(content)
    whole = [json.loads(line) for line in content.split(b"\n")[:-1]]
    assert [entry.seq for entry in read_journal(path)][: len(whole)] == [line["seq"] for line in whole]
    journal, entries = reopen(path)
    journal.append("event", 9.0, event="resumed")
    journal.close()
    after = read_journal(path)
    assert len(after) == len(entries) + 1
    assert after[:-1] == entries


def test_damage_in_the_middle_is_named_by_its_line(tmp_path: Path) -> None:
    path = written(tmp_path / "journal.jsonl")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], "{torn", lines[2]]) + "\n")
    with pytest.raises(JournalError, match=r"journal\.jsonl:2: "):
        read_journal(path)


def test_a_missing_journal_and_a_folder_that_cannot_be_written_are_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="No such file") as missing:
        read_journal(tmp_path / "journal.jsonl")
    with pytest.raises(JournalError, match="can be written") as closed:
        Journal(tmp_path / "nowhere" / "journal.jsonl")
    for error in (missing, closed):
        assert "\n" not in str(error.value)


class FullDisk:
    """A file on a disk that is full from the third line on."""

    def __init__(self, file: Any) -> None:
        self.file, self.lines = file, 0

    def write(self, line: bytes) -> None:
        self.lines += 1
        if self.lines > 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.file.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.file, name)


@pytest.mark.parametrize("threaded", [False, True])
def test_a_full_disk_is_told_once_and_later_lines_are_counted(tmp_path: Path, threaded: bool) -> None:
    told: list[str] = []

    async def write() -> Journal:
        journal = Journal(tmp_path / "journal.jsonl", threaded=threaded)
        journal.on_lost = told.append
        journal._file = FullDisk(journal._file)
        for number in range(6):
            journal.append("event", number, event="done")
        await journal.durable()
        journal.close()
        return journal

    journal = asyncio.run(write())
    assert journal.lost == 4
    assert len(told) == 1 and "No space left" in told[0] and "\n" not in told[0]
    assert len(read_journal(tmp_path / "journal.jsonl")) == 2


def test_a_full_disk_brings_the_vehicle_home(fly: Any) -> None:
    flight = fly(
        {
            "fly": {"do": "wait", "on": {"abort": "land", "step": "more"}},
            "more": {"do": "wait", "on": {"abort": "land"}},
            "land": {"do": "finish", "on": {"done": "aborted"}},
            "aborted": {"final": "aborted"},
        },
        at=[
            (
                1.0,
                lambda executive: setattr(
                    executive._chronicle.journal, "_file", FullDisk(executive._chronicle.journal._file)
                ),
            ),
            (2.0, lambda executive: executive.raise_event("step")),
            (3.0, lambda executive: executive.raise_event("step")),
        ],
    )
    assert flight.run().outcome == "aborted"
    assert "No space left" in flight.executive.status().journal_error


class Killed(BaseException):
    """Stands for SIGKILL: nothing after it happens."""


def test_a_transition_is_in_the_journal_before_it_has_any_effect(fly: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[str] = []

    async def second(services: Any, parameters: Any) -> str:
        started.append("second")
        return "done"

    flight = fly(
        {"one": {"do": "finish", "on": {"done": "two"}}, "two": {"do": "second"}, "aborted": {"final": "aborted"}},
        {"second": second},
    )

    async def killed(self: Machine, *event: Any) -> None:
        raise Killed

    monkeypatch.setattr(Machine, "take", killed)
    with pytest.raises(Killed):
        flight.run()
    assert flight.walked == ["two"]
    assert started == []


def test_until_a_transition_is_in_the_journal_nothing_of_it_happens(fly: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    flight = fly(
        {"one": {"do": "finish", "on": {"done": "two"}}, "two": {"do": "wait"}, "aborted": {"final": "aborted"}}
    )
    moved: list[str] = []
    take, append = Machine.take, Journal.append

    async def watched(self: Machine, *event: Any) -> Any:
        moved.append(str(event[0]))
        return await take(self, *event)

    def killed(self: Journal, kind: str, t: float, **fields: Any) -> Any:
        if kind == "transition":
            raise Killed
        return append(self, kind, t, **fields)

    monkeypatch.setattr(Machine, "take", watched)
    monkeypatch.setattr(Journal, "append", killed)
    with pytest.raises(Killed):
        flight.run()
    assert moved == [] and isinstance(flight.executive, Executive)
    assert flight.executive.status().path == "one"
