"""`mission replay`: the run again, line by line, and the first difference in words."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest

from mission.cli.main import main
from mission.executive.journal import Journal
from mission.language.document import load

WALK = ("launch", "square.north", "square.east")


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A run of the square that was cut off at its second corner."""
    folder = tmp_path / "20260101T000000Z-square"
    folder.mkdir()
    mission = load("missions/square.yaml")
    (folder / "mission.yaml").write_text(mission.resolved_yaml)
    journal = Journal(folder / "journal.jsonl", sync=False)
    about: dict[str, Any] = {"history": {}, "taken": {}}
    journal.append("start", 0.0, format=1, autonomy="full", resumed=False, state="preflight", **about)
    state = "preflight"
    for number, to in enumerate(WALK):
        event = {"preflight": "passed", "launch": "done"}.get(state, "arrived")
        key = f"{state}:{event}#0"
        journal.append("event", 5.0 * number, event=event, state=state, led_to="transition")
        journal.append("transition", 5.0 * number, event=event, by=event, key=key, **{"from": state, "to": to}, **about)
        state = to
    journal.append("event", 20.0, event="link_restored", state=state, led_to="ignored")
    journal.close()
    return tmp_path


def test_it_prints_every_event_and_says_that_all_was_the_same(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", "latest", "--record", str(logs)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("→ ")[1] for line in lines[:3]] == list(WALK)
    assert "ignored in square.east" in lines[3]
    assert "4 events, 3 transitions, all as recorded" in lines[4]


def test_it_begins_where_it_is_asked_to_and_goes_as_fast(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", "latest", "--record", str(logs), "--from", "9", "--speed", "1000"]) == 0
    assert "square.north" not in capsys.readouterr().out


def test_it_steps_by_lines_of_input_and_ends_with_them(
    logs: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    assert main(["replay", "latest", "--record", str(logs), "--step"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert "2 events, 2 transitions, all as recorded so far: the input ended" in lines[2]


def test_a_changed_mission_shows_where_it_differs(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changed = logs / "changed.yaml"
    resolved = (logs / "20260101T000000Z-square" / "mission.yaml").read_text()
    for before, after in {"east": "SOUTH", "south": "WEST", "west": "EAST"}.items():
        assert f"{{arrived: {before}}}" in resolved
        resolved = resolved.replace(f"{{arrived: {before}}}", f"{{arrived: {after}}}")
    for name in ("EAST", "SOUTH", "WEST"):
        resolved = resolved.replace(name, name.lower())
    changed.write_text(resolved)
    assert main(["replay", "latest", "--record", str(logs), "--mission", str(changed)]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "journal.jsonl:7: arrived: recorded square.north → square.east" in error and "→ square.south" in error


@pytest.mark.parametrize(
    "damage, said",
    [
        (lambda text: text.replace('"format": 1', '"format": 7'), "format 7, this program reads format 1"),
        (lambda text: text.replace("link_restored", "tea_time"), "'tea_time'"),
        (lambda text: "nonsense\n" + text, "journal.jsonl:1"),
        (lambda text: text.replace("launch:done#0", "launch:done#9"), "launch:done#9"),
    ],
)
def test_a_record_that_cannot_be_played_says_exactly_why(
    logs: Path, capsys: pytest.CaptureFixture[str], damage: Any, said: str
) -> None:
    path = logs / "20260101T000000Z-square" / "journal.jsonl"
    path.write_text(damage(path.read_text()))
    assert main(["replay", "latest", "--record", str(logs)]) in (1, 2)
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_a_torn_last_line_is_left_out(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = logs / "20260101T000000Z-square" / "journal.jsonl"
    path.write_text(path.read_text()[:-20])
    assert main(["replay", "latest", "--record", str(logs)]) == 0
    assert "3 events" in capsys.readouterr().out


def test_lines_of_a_later_version_do_no_harm(logs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = logs / "20260101T000000Z-square" / "journal.jsonl"
    lines = path.read_text().splitlines()
    extra = json.dumps({"seq": len(lines), "t": 21.0, "kind": "a later kind", "of": "line"})
    path.write_text("\n".join([*lines, extra]) + "\n")
    assert main(["replay", "latest", "--record", str(logs)]) == 0
