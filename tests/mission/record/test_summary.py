"""summary.json says what the files say, also when the program was killed in the middle of a line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mission.record.folder import RunFolder, create
from mission.record.history import RunHistory
from mission.record.summary import summarise, write_summary
from tests.mission.record.synthetic_run import MISSION, flown, fly, write_journal

KEYS = {
    "mission", "run", "outcome", "final_state", "simulated", "duration_s", "wall_s", "speed_factor", "states",
    "standoff", "coverage", "tip", "root", "vision", "frames",
}  # fmt: skip


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    return flown(tmp_path_factory.mktemp("logs"), distance_m=3.1)


def test_it_has_every_figure_that_its_readers_rely_on(run: RunFolder) -> None:
    summary = write_summary(run)
    assert summary.keys() >= KEYS
    assert json.loads(run.summary.read_text()) == summary
    assert set(summary["states"][0]) == {"state", "entered_s", "left_s", "by"}
    assert set(summary["standoff"]) == {"target_m", "rmse_m", "min_m", "max_m"}
    assert {"cycles", "accepted", "bridged", "longest_gap_s", "p50_ms", "p99_ms"} <= set(summary["vision"])


def test_a_completed_flight_in_numbers(run: RunFolder) -> None:
    summary = summarise(RunHistory(run))
    assert (summary["outcome"], summary["final_state"]) == ("completed", "completed")
    assert summary["duration_s"] == 200.0
    assert summary["standoff"] == {"target_m": 3.0, "rmse_m": 0.1, "min_m": 3.1, "max_m": 3.1}
    assert summary["tip"] == {"found": True, "radius_m": 39.8}
    assert summary["root"] == {"found": True, "radius_m": 1.2}
    assert summary["vision"]["cycles"] == summary["vision"]["accepted"] == 500
    assert summary["vision"]["longest_gap_s"] == pytest.approx(0.2)
    assert summary["setpoints"]["rate_hz"] == pytest.approx(25.0)
    assert summary["setpoints"]["longest_gap_ms"] == pytest.approx(40.0)
    leading = next(state for state in summary["states"] if state["state"] == "inspect.leading")
    assert leading == {"state": "inspect.leading", "entered_s": 60.0, "left_s": 110.0, "by": "tip_detected"}


def test_a_completed_flight_covers_the_blade(run: RunFolder) -> None:
    coverage = summarise(RunHistory(run))["coverage"]
    assert coverage["leading"] == pytest.approx(1.0, abs=0.01)
    assert coverage["trailing"] == pytest.approx(1.0, abs=0.01)


def test_a_stretch_that_was_never_seen_is_missing_from_the_coverage(tmp_path: Path) -> None:
    """Nothing is accepted from 18 to 28 m; the frames beside the gap show 1.29 m of it at either end."""
    summary = summarise(RunHistory(flown(tmp_path, skip=(18.0, 28.0))))
    assert summary["coverage"]["leading"] == pytest.approx(1 - (10 - 2 * 1.29) / 39, abs=0.02)
    assert summary["vision"]["bridged"] > 100
    assert summary["vision"]["longest_gap_s"] == pytest.approx(10 / 39 * 50, abs=0.5)


def test_wall_time_runs_from_the_folder_s_making_to_the_last_line_of_the_log(tmp_path: Path) -> None:
    folder = create(tmp_path, "a", MISSION)
    lines = [
        {"event": "run_created", "timestamp": "2026-11-21T10:00:00Z"},
        {"event": "transition", "timestamp": "2026-11-21T10:00:09.5Z"},
        {"event": "run_ended", "timestamp": "2026-11-21T10:00:50Z"},
    ]
    assert json.loads(folder.log.read_text())["event"] == "run_created"
    folder.log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    write_journal(folder)
    summary = summarise(RunHistory(folder))
    assert (summary["wall_s"], summary["speed_factor"]) == (50.0, 4.0)


def test_a_stream_that_was_stopped_on_purpose_has_no_gap(tmp_path: Path) -> None:
    folder = create(tmp_path, "a", MISSION)
    rows = ["wall_s,t,bounded,first", "0.00,0,0,1", "0.04,1,0,0", "9.00,2,0,1", "9.05,3,0,0", "9.25,4,0,0"]
    (folder.telemetry / "setpoints.csv").write_text("\n".join(rows) + "\n")
    setpoints = summarise(RunHistory(folder))["setpoints"]
    assert setpoints["longest_gap_ms"] == pytest.approx(200.0)
    assert setpoints["rate_hz"] == pytest.approx(3 / 0.29, rel=1e-3)


def test_the_reason_for_an_abort_is_the_event_that_led_there(tmp_path: Path) -> None:
    folder = create(tmp_path, "a", MISSION)
    lines = [
        {"seq": 0, "t": 0.0, "kind": "start", "state": "inspect.leading"},
        {"seq": 1, "t": 5.0, "kind": "event", "event": "wind_high", "state": "inspect.leading", "led_to": "ignored"},
        {
            "seq": 2,
            "t": 9.0,
            "kind": "event",
            "event": "too_close",
            "led_to": "transition",
            "data": {"reason": "1.4 m"},
        },
        {
            "seq": 3,
            "t": 9.0,
            "kind": "transition",
            "event": "too_close",
            "from": "inspect.leading",
            "to": "abort.back_off",
        },
        {"seq": 4, "t": 30.0, "kind": "transition", "event": "done", "from": "abort.back_off", "to": "aborted"},
        {"seq": 5, "t": 30.0, "kind": "end", "outcome": "aborted", "state": "aborted"},
    ]
    folder.journal.write_text("".join(json.dumps(line) + "\n" for line in lines))
    summary = summarise(RunHistory(folder))
    assert summary["outcome"] == "aborted"
    assert summary["why"] == "too_close in inspect.leading: 1.4 m"


def test_a_killed_run_tells_where_it_was(tmp_path: Path) -> None:
    folder = create(tmp_path, "v80_blade", MISSION)
    fly(folder, until_s=95.0)
    write_journal(folder, until_s=90.0)
    summary = summarise(RunHistory(folder))
    assert summary["outcome"] == "unfinished"
    assert summary["final_state"] == "inspect.leading"
    assert summary["duration_s"] == pytest.approx(95.0, abs=0.3)
    assert 0.6 < summary["coverage"]["leading"] < 0.8
    assert summary["coverage"].keys() == {"leading"}


def test_a_run_that_left_only_its_mission_still_has_a_summary(tmp_path: Path) -> None:
    summary = summarise(RunHistory(create(tmp_path, "v80_blade", MISSION)))
    assert summary["outcome"] == "unfinished"
    assert summary["states"] == []


@pytest.fixture(scope="module")
def short_run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    folder = create(tmp_path_factory.mktemp("short"), "v80_blade", MISSION)
    fly(folder, until_s=64.0)
    write_journal(folder)
    return folder


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_files_torn_at_any_byte_are_read_up_to_there(
    short_run: RunFolder, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    torn = RunFolder(tmp_path_factory.mktemp("torn") / "run")
    shutil.copytree(short_run.path, torn.path, ignore=shutil.ignore_patterns("*.jpg"))
    whole = summarise(RunHistory(short_run))
    for path in (torn.journal, torn.log, *torn.telemetry.iterdir(), torn.frames / "frames.jsonl"):
        content = path.read_bytes()
        path.write_bytes(content[: data.draw(st.integers(0, len(content)), label=path.name)])
    summary = summarise(RunHistory(torn))
    assert summary["vision"]["cycles"] <= whole["vision"]["cycles"]
    assert summary["frames"] <= whole["frames"]
    assert summary["states"] == [] or summary["states"][0]["state"] == "preflight"
