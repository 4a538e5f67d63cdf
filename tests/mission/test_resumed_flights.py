"""A program that was killed in flight: the next one finds the vehicle where it is and flies what is left."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest

from devices.vehicle.handover import note_in
from devices.vehicle.keeper import Guardian
from mission.behaviours.approach_root import OVERLAP_M
from mission.executive.journal import FORMAT
from mission.executive.services import Memory, Stretch
from mission.language.document import load
from mission.record.folder import create
from tests.mission.test_flights import ROOT, SHORT_BLADE, SQUARE, command, journal, vehicle_events, wait_for


@pytest.fixture
def logs(tmp_path: Path) -> Iterator[Path]:
    """A folder for runs; their vehicles are gone after the test."""
    yield tmp_path
    end_vehicles(tmp_path)


def end_vehicles(logs: Path) -> None:
    for run in runs(logs):
        note = note_in(run)
        if note is not None and b"devices.vehicle" in command_line(note.pid):
            os.kill(note.pid, signal.SIGKILL)


def command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def runs(logs: Path) -> list[Path]:
    return sorted(path.parent for path in logs.glob("*/mission.yaml"))


def visited(run: Path) -> list[str]:
    return [line["to"] for line in journal(run) if line["kind"] == "transition"]


def killed_in(state: str, logs: Path, *words: str, before: Callable[[], None] = lambda: None) -> None:
    """Run a command and kill it half a second after a state was entered; `before` that, do something else."""
    with subprocess.Popen(list(words), cwd=ROOT, stdout=subprocess.DEVNULL, start_new_session=True) as process:
        try:
            wait_for(lambda: bool(runs(logs)) and bool(journal(runs(logs)[-1])))
            before()
            wait_for(lambda: any(state in visited(run) for run in runs(logs)))
            time.sleep(0.5)
        finally:
            process.kill()


def resume(logs: Path, *options: str) -> tuple[int, str]:
    words = [word for word in command("latest", logs, *options) if word != "latest"]
    done = subprocess.run(
        [*words, "--resume", "latest"], cwd=ROOT, capture_output=True, text=True, timeout=280, check=False
    )
    return done.returncode, done.stdout + done.stderr


def test_killed_twice_the_vehicle_is_found_flying_and_no_corner_is_flown_again(logs: Path) -> None:
    def is_refused_while_it_flies() -> None:
        code, said = resume(logs)
        assert code == 2 and "still flown" in said and said.count("\n") == 1
        assert len(runs(logs)) == 1

    killed_in("square.east", logs, *command(SQUARE, logs, "--speed", "4"), before=is_refused_while_it_flies)
    words = [word for word in command("", logs) if word]
    killed_in("square.south", logs, *words, "--resume", "latest")
    code, said = resume(logs)
    assert code == 0 and "Traceback" not in said, said
    first, second, third = runs(logs)
    corners = [state for run in (first, second, third) for state in visited(run) if state.startswith("square.")]
    assert corners == [f"square.{corner}" for corner in ("north", "east", "south", "west", "down")]
    assert [journal(run)[0]["state"] for run in (second, third)] == ["square.east", "square.south"]
    kinds = [event["kind"] for run in (first, second, third) for event in vehicle_events(run)]
    assert kinds.count("takeoff") == 1 and kinds.count("parent_died") == 2
    assert "failsafe" in kinds, "between two programs it was left to its own failsafe"
    assert "no report" not in said, said
    told: dict[str, Any] = json.loads((third / "summary.json").read_text())
    assert told["outcome"] == "completed" and told["continues"] == [first.name, second.name]
    note = note_in(third)
    assert note is not None and not Guardian(note.pid).alive


def test_after_a_power_failure_it_begins_on_the_ground_with_a_torn_journal(logs: Path) -> None:
    killed_in("square.north", logs, *command(SQUARE, logs, "--speed", "4"))
    end_vehicles(logs)
    (first,) = runs(logs)
    with (first / "journal.jsonl").open("ab") as file:
        file.write(b'{"seq": 99, "t": 60.0, "kind": "tra\0\0\0')
    code, said = resume(logs)
    assert code == 0 and "Traceback" not in said, said
    assert visited(runs(logs)[-1])[:2] == ["launch", "square.north"]
    assert json.loads((runs(logs)[-1] / "summary.json").read_text())["outcome"] == "completed"


def half_flown(logs: Path) -> None:
    """The folder of a run that was cut off on its way back along the trailing side, six metres and a half from the
    hub."""
    run = create(logs, "v80_blade", load("missions/v80_blade.yaml", SHORT_BLADE).resolved_yaml)
    memory = Memory(
        home=(0.0, 0.0, 0.0),
        azimuth=math.radians(45.0),
        tip_station_m=9.9,
        passes_done=["leading"],
        inspected={"leading": Stretch(4.0, 8.8, 0.24), "trailing": Stretch(9.2, 6.6, -0.61)},
    )
    configuration = {"history": {}, "taken": {}}
    lines: list[dict[str, Any]] = [
        {"seq": 0, "t": 0.0, "kind": "start", "format": FORMAT, "state": "preflight", **configuration},
        {
            "seq": 1,
            "t": 90.0,
            "kind": "transition",
            "event": "in_position",
            "key": "",
            "from": "inspect.blade.reposition",
        }
        | {"to": "inspect.blade.trailing", "by": "in_position", "memory": asdict(memory), **configuration},
    ]
    run.journal.write_text("".join(json.dumps(line) + "\n" for line in lines))


@pytest.mark.timeout(300)
def test_of_a_half_flown_inspection_only_the_rest_is_flown(logs: Path) -> None:
    half_flown(logs)
    code, said = resume(logs, "--lockstep")
    assert code == 0 and "Traceback" not in said, said
    last = runs(logs)[-1]
    flown = visited(last)
    assert "inspect.blade.trailing" in flown and flown[-1] == "completed"
    assert not {"inspect.blade.leading", "inspect.blade.align_gimbal", "inspect.blade.reposition"} & set(flown)
    frames = [json.loads(line) for line in (last / "frames" / "frames.jsonl").read_text().splitlines()]
    assert {frame["side"] for frame in frames} == {"trailing"}
    assert max(frame["station_m"] for frame in frames) == pytest.approx(6.6 + OVERLAP_M, abs=0.5)
    told: dict[str, Any] = json.loads((last / "summary.json").read_text())
    assert told["root"]["found"] and told["tip"]["radius_m"] == 9.9
    assert told["truth"]["min_clearance_m"] >= 2.0
