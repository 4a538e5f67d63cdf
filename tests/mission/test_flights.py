"""Whole flights with the command that users type: over MAVSDK and a socket, and in lockstep time."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
SQUARE = "missions/square.yaml"
SHORT_BLADE = (
    "turbine.blade_length_m=9",
    "turbine.max_chord_m=1.7",
    "turbine.root_diameter_m=0.9",
    "turbine.hub_height_m=30",
    "site.turbine_north_m=40",
)


def command(mission: str, logs: Path, *options: str) -> list[str]:
    return [sys.executable, "-m", "mission", "run", mission, "--headless", "--record", str(logs), *options]


def fly(mission: str, logs: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(mission, logs, *options), cwd=ROOT, capture_output=True, text=True, timeout=280, check=False
    )


def the_run(logs: Path) -> Path:
    (run,) = [path for path in logs.iterdir() if path.is_dir()]
    return run


def summary(logs: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads((the_run(logs) / "summary.json").read_text())
    return loaded


def journal(run: Path) -> list[dict[str, Any]]:
    path = run / "journal.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def vehicle_events(run: Path) -> list[dict[str, Any]]:
    path = run / "telemetry" / "vehicle_events.jsonl"
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def wait_for(condition: Callable[[], bool], patience_s: float = 120.0) -> None:
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.1)


def reached(logs: Path, state: str) -> bool:
    return any(entry.get("to") == state for run in logs.iterdir() for entry in journal(run))


def test_a_square_is_flown_over_mavsdk_and_recorded(tmp_path: Path) -> None:
    done = fly(SQUARE, tmp_path, "--speed", "4")
    assert done.returncode == 0, done.stdout + done.stderr
    run = the_run(tmp_path)
    assert summary(tmp_path)["outcome"] == "completed"
    visited = [entry["to"] for entry in journal(run) if entry["kind"] == "transition"]
    assert visited[:6] == ["launch", "square.north", "square.east", "square.south", "square.west", "square.down"]
    assert (run / "report.html").exists() and (run / "telemetry" / "truth.csv").exists()
    assert "Traceback" not in done.stdout + done.stderr


def test_two_lockstep_flights_with_one_seed_leave_identical_journals(tmp_path: Path) -> None:
    journals = []
    for name in ("first", "second"):
        done = fly(SQUARE, tmp_path / name, "--lockstep", "--seed", "7")
        assert done.returncode == 0, done.stdout + done.stderr
        journals.append((the_run(tmp_path / name) / "journal.jsonl").read_bytes())
    assert journals[0] == journals[1]


@pytest.mark.timeout(300)
def test_a_short_blade_is_inspected_in_lockstep(tmp_path: Path) -> None:
    settings = [word for setting in SHORT_BLADE for word in ("--set", setting)]
    done = fly("missions/v80_blade.yaml", tmp_path, "--lockstep", *settings)
    assert done.returncode == 0, done.stdout + done.stderr
    told = summary(tmp_path)
    truth = told["truth"]
    assert told["outcome"] == "completed" and told["tip"]["found"] and told["root"]["found"]
    assert truth["min_clearance_m"] >= 2.0 and not truth["collision"]
    assert truth["standoff_rmse_m"] <= 0.25
    assert abs(truth["tip_error_m"]) <= 0.6
    assert min(truth["coverage"].values()) >= 0.85


def test_ctrl_c_flies_the_abort_path_and_completes_the_record(tmp_path: Path) -> None:
    with subprocess.Popen(command(SQUARE, tmp_path, "--speed", "4"), cwd=ROOT, stdout=subprocess.DEVNULL) as process:
        try:
            wait_for(lambda: reached(tmp_path, "square.east"))
            process.send_signal(signal.SIGINT)
            assert process.wait(120) == 130
        finally:
            process.kill()
    told = summary(tmp_path)
    assert told["outcome"] == "aborted" and told["final_state"] == "aborted"
    assert journal(the_run(tmp_path))[-1]["kind"] == "end"


def test_a_connection_that_never_answers_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    done = fly(SQUARE, tmp_path, "--system", "udpout://127.0.0.1:9", "--speed", "1")
    assert done.returncode == 3
    assert len((done.stdout + done.stderr).strip().splitlines()) <= 2
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
