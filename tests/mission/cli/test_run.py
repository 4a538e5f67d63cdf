"""`mission run`: what it refuses before anything flies, what it leaves behind, and how it ends."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mission.executive import assembly
from mission.executive.assembly import FlightError, FlightOptions, FlightResult
from mission.executive.journal import FORMAT, Journal
from mission.record.folder import RunFolder
from tests.mission.cli.conftest import Call
from tests.mission.cli.program import ROOT
from tests.mission.record.synthetic_run import write_journal

BLADE = ROOT / "missions" / "v80_blade.yaml"

Fly = Callable[[FlightOptions], FlightResult]


@pytest.fixture
def flights(monkeypatch: pytest.MonkeyPatch) -> Callable[[Fly], list[FlightOptions]]:
    """Replace the flight by a function; returns what each flight was asked to do."""

    def use(fly: Fly) -> list[FlightOptions]:
        asked: list[FlightOptions] = []

        def noted(options: FlightOptions) -> FlightResult:
            asked.append(options)
            return fly(options)

        monkeypatch.setattr(assembly, "fly", noted)
        return asked

    return use


def ends(outcome: str, interrupted: bool = False) -> Fly:
    def fly(options: FlightOptions) -> FlightResult:
        write_journal(options.folder)
        text = options.folder.journal.read_text().replace('"outcome": "completed"', f'"outcome": "{outcome}"')
        options.folder.journal.write_text(text)
        return FlightResult(outcome, outcome, interrupted)

    return fly


@pytest.mark.parametrize(
    ("outcome", "interrupted", "code"),
    [
        ("completed", False, 0),
        ("aborted", False, 1),
        ("released", False, 1),
        ("refused", False, 3),
        ("aborted", True, 130),
    ],
)
def test_the_exit_code_says_how_it_ended(
    call: Call, flights: Any, tmp_path: Path, outcome: str, interrupted: bool, code: int
) -> None:
    flights(ends(outcome, interrupted))
    said = call("run", BLADE, "--record", tmp_path, "--headless")
    assert said.code == code
    assert said.err == ""
    (folder,) = tmp_path.iterdir()
    assert json.loads((folder / "summary.json").read_text())["outcome"] == outcome
    assert (folder / "report.html").is_file()
    assert str(folder) in said.out
    assert said.out.count(outcome) >= 1


def test_the_resolved_mission_lies_in_the_folder_before_the_flight_begins(
    call: Call, flights: Any, tmp_path: Path
) -> None:
    seen: list[str] = []

    def fly(options: FlightOptions) -> FlightResult:
        seen.append(options.folder.mission.read_text())
        return ends("completed")(options)

    flights(fly)
    call("run", BLADE, "--record", tmp_path, "--set", "turbine.azimuth_deg=123.5", "--seed", "77")
    assert "123.5" in seen[0]
    assert "seed: 77" in seen[0]


def test_what_was_asked_reaches_the_flight(call: Call, flights: Any, tmp_path: Path) -> None:
    asked = flights(ends("completed"))
    call("run", BLADE, "--record", tmp_path, "--speed", "2", "--autonomy", "confirm", "--system", "udpin://127.0.0.1:1")
    call("run", BLADE, "--record", tmp_path, "--lockstep")
    assert (asked[0].speed, asked[0].autonomy, asked[0].system) == (2.0, "confirm", "udpin://127.0.0.1:1")
    assert (asked[0].lockstep, asked[0].resume) == (False, None)
    assert asked[1].lockstep


def test_a_flight_that_cannot_begin_is_one_line_and_leaves_no_folder(call: Call, flights: Any, tmp_path: Path) -> None:
    def fly(options: FlightOptions) -> FlightResult:
        raise FlightError("no vehicle answered at udpin://0.0.0.0:14540 within 20 s; is it switched on?")

    flights(fly)
    said = call("run", BLADE, "--record", tmp_path / "logs")
    said.assert_one_line(3)
    assert "no vehicle answered" in said.err
    assert list((tmp_path / "logs").iterdir()) == []


def test_a_no_to_arming_is_exit_code_3_and_leaves_no_folder(call: Call, flights: Any, tmp_path: Path) -> None:
    flights(lambda options: FlightResult("refused", "preflight", False))
    said = call("run", BLADE, "--record", tmp_path / "logs")
    said.assert_one_line(3)
    assert list((tmp_path / "logs").iterdir()) == []


def test_ctrl_c_before_anything_flew_is_exit_code_130_and_leaves_no_folder(
    call: Call, flights: Any, tmp_path: Path
) -> None:
    def fly(options: FlightOptions) -> FlightResult:
        raise KeyboardInterrupt

    flights(fly)
    said = call("run", BLADE, "--record", tmp_path / "logs")
    assert (said.code, said.err) == (130, "")
    assert list((tmp_path / "logs").iterdir()) == []


def test_a_completed_flight_stays_completed_when_its_report_cannot_be_written(
    call: Call, flights: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mission.record import summary

    def full(folder: RunFolder) -> None:
        raise OSError(28, "No space left on device")

    flights(ends("completed"))
    monkeypatch.setattr(summary, "write_summary", full)
    said = call("run", BLADE, "--record", tmp_path)
    said.assert_one_line(0)
    assert "No space left" in said.err
    assert "mission report" in said.err
    assert "completed in completed" in said.out


def test_a_crash_is_one_line_with_its_traceback_in_the_run_s_folder(call: Call, flights: Any, tmp_path: Path) -> None:
    def fly(options: FlightOptions) -> FlightResult:
        write_journal(options.folder, until_s=60.0)
        raise ZeroDivisionError("of all things")

    flights(fly)
    said = call("run", BLADE, "--record", tmp_path)
    assert said.code == 1
    assert said.err.count("\n") == 1
    (folder,) = tmp_path.iterdir()
    assert str(folder / "error.txt") in said.err
    assert "Traceback" in (folder / "error.txt").read_text()


def test_an_interrupted_run_is_found_by_its_name(call: Call, flights: Any, tmp_path: Path) -> None:
    def fly(options: FlightOptions) -> FlightResult:
        journal = Journal(options.folder.journal)
        journal.append("start", 0.0, format=FORMAT, resumed=False, state="launch", history={}, taken={})
        journal.close()
        return FlightResult("aborted", "launch", True)

    asked = flights(fly)
    call("run", BLADE, "--record", tmp_path)
    said = call("run", "--resume", "latest", "--record", tmp_path)
    assert said.code == 130, said.err
    assert isinstance(asked[1].folder, RunFolder)
    assert asked[1].resume == asked[0].folder.path
    assert asked[1].mission.name == "v80_blade"


def test_a_run_that_came_to_its_end_is_not_gone_on_with(call: Call, flights: Any, tmp_path: Path) -> None:
    asked = flights(ends("completed"))
    call("run", BLADE, "--record", tmp_path)
    said = call("run", "--resume", "latest", "--record", tmp_path)
    said.assert_one_line(2)
    assert "nothing to go on with" in said.err
    assert len(asked) == 1
    assert len(list(tmp_path.iterdir())) == 1


def a_real_rig(tmp_path: Path) -> Path:
    rig = tmp_path / "drone.yaml"
    rig.write_text(
        "kind: hardware\nsystem: serial:///dev/ttyACM0:921600\nspeed: 1.0\n"
        "camera: {width: 612, height: 512, focal_px: 616.0, baseline_m: 0.2}\n"
    )
    return rig


def test_a_real_vehicle_is_not_armed_without_a_yes(call: Call, flights: Any, tmp_path: Path) -> None:
    asked = flights(ends("completed"))
    said = call("run", BLADE, "--rig", a_real_rig(tmp_path), "--record", tmp_path / "logs")
    said.assert_one_line(2)
    assert "--yes" in said.err
    assert asked == []
    assert not (tmp_path / "logs").exists()


def test_yes_on_the_command_line_is_a_yes(call: Call, flights: Any, tmp_path: Path) -> None:
    asked = flights(ends("completed"))
    said = call("run", BLADE, "--rig", a_real_rig(tmp_path), "--record", tmp_path / "logs", "--yes")
    assert said.code == 0
    assert asked[0].confirm("Arm the vehicle?")


def test_without_yes_nobody_answers_for_the_operator(call: Call, flights: Any, tmp_path: Path) -> None:
    asked = flights(ends("completed"))
    call("run", BLADE, "--record", tmp_path)
    assert not asked[0].confirm("Arm the vehicle?")


def test_a_real_vehicle_does_not_fly_faster_than_time(call: Call, flights: Any, tmp_path: Path) -> None:
    flights(ends("completed"))
    rig = a_real_rig(tmp_path)
    call("run", BLADE, "--rig", rig, "--record", tmp_path / "logs", "--yes", "--speed", "4").assert_one_line(2)
    call("run", BLADE, "--rig", rig, "--record", tmp_path / "logs", "--yes", "--lockstep").assert_one_line(2)


@pytest.mark.parametrize("system", ["banana", "udpin://", "udpout://10.0.0.5"])
def test_an_address_that_is_none_is_a_wrong_command_line(call: Call, flights: Any, tmp_path: Path, system: str) -> None:
    asked = flights(ends("completed"))
    said = call("run", BLADE, "--system", system, "--record", tmp_path / "logs", "--yes")
    said.assert_one_line(2)
    assert system in said.err
    assert asked == []
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize("system", ["serial:///dev/ttyACM0:921600", "udpout://192.168.1.2:14580"])
def test_a_vehicle_on_a_serial_line_or_another_machine_is_real_whatever_the_rig_draws(
    call: Call, flights: Any, tmp_path: Path, system: str
) -> None:
    asked = flights(ends("completed"))
    said = call("run", BLADE, "--system", system, "--record", tmp_path / "logs")
    said.assert_one_line(2)
    assert "--yes" in said.err
    assert asked == []
    assert call("run", BLADE, "--system", system, "--record", tmp_path / "logs", "--yes").code == 0
    assert asked[0].must_confirm


def test_a_simulated_vehicle_that_sends_here_flies_without_a_yes(call: Call, flights: Any, tmp_path: Path) -> None:
    asked = flights(ends("completed"))
    assert call("run", BLADE, "--system", "udpin://0.0.0.0:14540", "--record", tmp_path).code == 0
    assert call("run", BLADE, "--record", tmp_path, "--set", "rig.confirm_arming=true", "--yes").code == 0
    assert [options.must_confirm for options in asked] == [False, True]


@pytest.mark.parametrize(
    ("flags", "named"), [(("--speed", "2"), "--speed"), (("--system", "udpin://0.0.0.0:14540"), "--system")]
)
def test_lockstep_names_the_flag_that_it_does_not_go_with(
    call: Call, flights: Any, tmp_path: Path, flags: tuple[str, ...], named: str
) -> None:
    flights(ends("completed"))
    said = call("run", BLADE, "--lockstep", *flags, "--record", tmp_path / "logs")
    said.assert_one_line(2)
    assert said.err.split("leave out ")[1].strip() == named


def test_a_serial_line_that_is_not_there_is_one_line(call: Call, tmp_path: Path) -> None:
    rig = tmp_path / "drone.yaml"
    rig.write_text("kind: hardware\nsystem: serial:///dev/ttyNOWHERE:57600\ncamera_driver: none\n")
    said = call("run", BLADE, "--rig", rig, "--record", tmp_path / "logs", "--yes", "--headless")
    said.assert_one_line(3)
    assert "there is no /dev/ttyNOWHERE" in said.err
    assert list((tmp_path / "logs").iterdir()) == []


def test_only_a_mission_that_takes_pictures_needs_room_for_them(
    call: Call, flights: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda path: type("Usage", (), {"free": 100 << 20}))
    flights(ends("completed"))
    assert call("run", ROOT / "missions" / "square.yaml", "--record", tmp_path / "a").code == 0
    said = call("run", BLADE, "--record", tmp_path / "b")
    said.assert_one_line(2)
    assert "needs 300 MB" in said.err


def test_a_parameter_that_the_simulated_autopilot_lacks_is_one_line(call: Call) -> None:
    for change in ("COM_NOTHING=1", "COM_OBL_RC_ACT", "COM_OBL_RC_ACT=much"):
        said = call("simulate", "--param", change)
        said.assert_one_line(2)
        assert change in said.err
