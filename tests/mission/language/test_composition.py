"""Missions are put together from files, references and overrides, and every mistake keeps its true place."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from mission.language.document import MissionFileError, load
from mission.language.loading import examine
from tests.mission.language.missions import MISSIONS, PREAMBLE, SMALL, STATES, examined, folder, line_of, only, written


def test_a_mission_extends_another_and_keeps_what_it_does_not_say(tmp_path: Path) -> None:
    written(tmp_path, SMALL, "base.yaml")
    path = written(tmp_path, "extends: base.yaml\nmission: other\nstates: {work: {with: {for_s: 9}}}\n", "other.yaml")
    mission = load(path)
    assert mission.name == "other"
    assert mission.states["work"].parameters.model_dump() == {"for_s": 9.0}
    assert mission.states["work"].timeout_s == 60


def test_nothing_removes_what_was_inherited(tmp_path: Path) -> None:
    written(tmp_path, SMALL, "base.yaml")
    path = written(tmp_path, "extends: base.yaml\nmission: other\nstates: {work: {on: {abort: ~}}}\n", "other.yaml")
    findings = examine(path).errors
    assert {finding.code for finding in findings} == {"M307"}
    assert "work" in findings[0].message


@pytest.mark.parametrize(
    ("below", "above", "file"),
    [
        ("timeout_s: 60, on: {done: home", "states: {work: {with: {for_s: 9}}}", "base.yaml"),
        ("", "states: {work: {timeout_s: ~}}", "other.yaml"),
        ("", "states: {work: {do: align_gimbal, with: ~}}", "other.yaml"),
    ],
)
def test_what_a_state_lacks_is_reported_in_the_file_that_lets_it_lack_it(
    tmp_path: Path, below: str, above: str, file: str
) -> None:
    base = written(tmp_path, SMALL.replace(below, below.removeprefix("timeout_s: 60, ")), "base.yaml")
    path = written(tmp_path, f"extends: base.yaml\nmission: other\n{above}\n", "other.yaml")
    finding = next(one for one in examine(path).errors if one.code in ("M303", "M306"))
    line = line_of(base.read_text(), "work: {do") if file == "base.yaml" else 3
    assert (Path(finding.location.file).name, finding.location.line) == (file, line), str(finding)


def test_a_file_is_named_without_detours(tmp_path: Path) -> None:
    missions = folder(tmp_path)
    (missions / "farm").mkdir()
    (missions / "base.yaml").write_text(
        SMALL.replace("timeout_s: 60, on: {done: home", "timeout_s: soon, on: {done: home")
    )
    (missions / "farm" / "other.yaml").write_text("extends: ../base.yaml\nmission: other\n")
    finding = only(examine(missions / "farm" / "other.yaml"))
    assert Path(finding.location.file) == missions / "base.yaml"


def test_a_value_that_cannot_be_read_is_reported_once(tmp_path: Path) -> None:
    for value in ('"${gone}"', "*gone", "!!python/name:os.system x"):
        only(examined(tmp_path, SMALL.replace("for_s: 5", f"for_s: {value}")))


@pytest.mark.parametrize(
    ("before", "after", "remedy"),
    [
        ("done: home,", "done:home,", "write done: home"),
        ("done: home,", "done=home,", "write done: home"),
        ("done: home,", "done home,", "write done: home"),
        ("work: {do: hold", "work: {Do: hold", "did you mean do?"),
    ],
)
def test_a_slip_of_the_pen_is_understood(tmp_path: Path, before: str, after: str, remedy: str) -> None:
    assert any(remedy in finding.hint for finding in examined(tmp_path, SMALL.replace(before, after)).errors)


def test_single_values_of_a_named_file_are_changed_by_extending_it(tmp_path: Path) -> None:
    written(tmp_path, SMALL, "base.yaml")
    over = "extends: base.yaml\nmission: other\nturbine: {azimuth_deg: 90}\n"
    finding = only(examine(written(tmp_path, over, "other.yaml")))
    assert finding.location.line == 3 and "turbine: {extends: FILE" in finding.hint
    right = over.replace("{azimuth", "{extends: turbines/v80.yaml, azimuth")
    assert load(written(tmp_path, right, "other.yaml")).turbine.azimuth_deg == 90


def test_a_misspelt_state_of_the_file_below_is_told_by_its_neighbour(tmp_path: Path) -> None:
    written(tmp_path, SMALL, "base.yaml")
    text = "extends: base.yaml\nmission: other\nstates: {wrok: {with: {for_s: 9}}}\n"
    findings = examine(written(tmp_path, text, "other.yaml")).errors
    assert [(finding.code, finding.hint) for finding in findings] == [("M214", "did you mean work?")]


def test_a_mistake_in_an_included_file_is_reported_there(tmp_path: Path) -> None:
    part = folder(tmp_path) / "parts" / "work.yaml"
    part.parent.mkdir()
    part.write_text("do: hold\n\nwith: {for_s: ten}\ntimeout_s: 60\n")
    text = PREAMBLE + STATES.replace(
        "work: {do: hold, with: {for_s: 5}, timeout_s: 60,", "work: {include: parts/work.yaml,"
    )
    finding = only(examined(tmp_path, text))
    assert finding.location.file.endswith("work.yaml")
    assert (finding.code, finding.location.line, finding.location.column) == ("M203", 3, 15)


def test_files_that_include_each_other_are_refused_at_the_line_that_closes_the_circle(tmp_path: Path) -> None:
    missions = folder(tmp_path)
    (missions / "a.yaml").write_text("text: a\ninclude: b.yaml\n")
    (missions / "b.yaml").write_text("text: b\n\ninclude: a.yaml\n")
    findings = examine(missions / "a.yaml").diagnostics
    circle = [finding for finding in findings if finding.code == "M102"]
    assert [(Path(one.location.file).name, one.location.line) for one in circle] == [("b.yaml", 3)]


def test_a_reference_takes_the_parameter_with_its_type(tmp_path: Path) -> None:
    text = SMALL.replace("for_s: 5", 'for_s: "${wait_s}"').replace(
        "initial: pre", "parameters: {wait_s: 7}\ninitial: pre"
    )
    mission = load(written(tmp_path, text))
    assert mission.states["work"].parameters.model_dump() == {"for_s": 7.0}


def test_a_wrong_parameter_is_reported_where_it_is_defined_and_names_where_it_is_used(tmp_path: Path) -> None:
    text = SMALL.replace("for_s: 5", 'for_s: "${wait_s}"').replace(
        "initial: pre", "parameters:\n  wait_s: -7\ninitial: pre"
    )
    finding = only(examined(tmp_path, text))
    assert (finding.code, finding.location.line) == ("M204", line_of(text, "wait_s: -7"))
    assert f"small.yaml:{line_of(text, '${wait_s}')}" in finding.message


def test_parameters_belong_to_the_nearest_state_around(tmp_path: Path) -> None:
    text = SMALL.replace(
        "work: {do: hold, with: {for_s: 5}", 'work: {parameters: {wait_s: 3}, do: hold, with: {for_s: "${wait_s}"}'
    )
    text = text.replace("initial: pre", "parameters: {wait_s: 7, height_m: 9}\ninitial: pre")
    text = text.replace("do: take_off,", 'do: take_off, with: {height_m: "${height_m}"},')
    examination = examined(tmp_path, text)
    assert examination.mission is not None
    assert examination.mission.states["work"].parameters.model_dump() == {"for_s": 3.0}
    assert [(finding.code, "wait_s" in finding.message) for finding in examination.diagnostics] == [("M107", True)]


@pytest.mark.parametrize(
    ("parameters", "code"),
    [("{a_s: '${b_s}', b_s: '${a_s}'}", "M105"), ("{c_s: 1}", "M104"), ("{a_s: '${missing}'}", "M104")],
)
def test_references_to_nothing_and_in_circles_are_refused(tmp_path: Path, parameters: str, code: str) -> None:
    text = SMALL.replace("for_s: 5", 'for_s: "${a_s}"').replace(
        "initial: pre", f"parameters: {parameters}\ninitial: pre"
    )
    assert code in {finding.code for finding in examined(tmp_path, text).errors}


def test_an_override_changes_the_resolved_document() -> None:
    mission = load(
        MISSIONS / "v80_blade.yaml",
        ["turbine.azimuth_deg=90", "world.wind.mean_m_s=8", "world.faults.images.every_s=20", "rig.speed=2"],
    )
    assert mission.turbine.azimuth_deg == 90 and mission.rig.speed == 2
    assert mission.world is not None and mission.world.wind.mean_m_s == 8
    assert mission.world.faults.images is not None and mission.world.faults.images.every_s == 20


@pytest.mark.parametrize(
    ("override", "code", "hint"),
    [
        ("turbine.azimut_deg=90", "M202", "azimuth_deg"),
        ("turbine.azimuth_deg=north", "M203", ""),
        ("world.wind.mean_m_s=800", "M204", ""),
        ("wrld.wind.mean_m_s=8", "M106", "world"),
        ("states.launsh.timeout_s=8", "M106", "launch"),
        ("turbine.azimuth_deg", "M106", ""),
        ("limits.clearance_m=[", "M106", ""),
        ("rig=rigs/simulated.yaml", "M106", "--rig"),
        ("states.launch.on.done=nowhere", "M212", ""),
    ],
)
def test_a_wrong_override_is_blamed_by_its_own_text(override: str, code: str, hint: str) -> None:
    with pytest.raises(MissionFileError) as caught:
        load(MISSIONS / "v80_blade.yaml", [override])
    line = str(caught.value)
    assert line.startswith(f"--set {override}: {code} ") and hint in line and "\n" not in line


def test_what_is_recorded_is_what_was_flown(tmp_path: Path) -> None:
    mission = load(MISSIONS / "v80_blade.yaml", ["parameters.speed_m_s=1.1", "world.seed=7"])
    path = tmp_path / "mission.yaml"
    path.write_text(mission.resolved_yaml)
    again = load(path)
    assert yaml.safe_load(again.resolved_yaml) == yaml.safe_load(mission.resolved_yaml)
    assert (again.turbine, again.rig, again.site, again.world, again.limits) == (
        mission.turbine, mission.rig, mission.site, mission.world, mission.limits,
    )  # fmt: skip
    assert [(s.path, s.do, s.parameters, s.timeout_s) for s in again.states.values()] == [
        (s.path, s.do, s.parameters, s.timeout_s) for s in mission.states.values()
    ]


def test_a_newer_format_is_refused_and_an_older_one_brought_up_to_date(tmp_path: Path) -> None:
    newer = only(examined(tmp_path, SMALL.replace("version: 1", "version: 2")))
    assert (newer.code, newer.location.line) == ("M206", 2)
    old = SMALL.replace("version: 1", "version: 0").replace("timeout_s", "timeout")
    mission = load(written(tmp_path, old, "old.yaml"))
    assert mission.version == 1 and mission.states["launch"].timeout_s == 60


def test_a_calibration_is_found_from_the_rig_file_and_from_the_record(tmp_path: Path) -> None:
    missions = folder(tmp_path)
    rig = (missions / "rigs" / "simulated.yaml").read_text()
    section = rig[rig.index("camera:\n  width") : rig.index("laser:")]
    (missions / "rigs" / "calibrated.yaml").write_text(rig.replace(section, "camchain: camchain.yaml\n"))
    text = SMALL.replace("rigs/simulated.yaml", "rigs/calibrated.yaml")
    missing = only(examine(written(tmp_path, text)))
    assert missing.code == "M101" and missing.location.file.endswith("calibrated.yaml")
    (missions / "rigs" / "camchain.yaml").write_text("cam0: {}\n")
    mission = load(written(tmp_path, text))
    assert mission.rig.camchain == str(missions / "rigs" / "camchain.yaml")
    run = tmp_path / "run"
    run.mkdir()
    (run / "mission.yaml").write_text(mission.resolved_yaml)
    assert [finding.code for finding in examine(run / "mission.yaml").errors] == ["M103"]
    (run / "journal.jsonl").write_text("")
    assert load(run / "mission.yaml").rig.camchain == mission.rig.camchain
