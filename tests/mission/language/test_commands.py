"""The commands of the language: what they print, for whom, and how they exit."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from mission.behaviours.behaviour import behaviours
from mission.cli.main import main
from mission.executive.events import EVENTS
from mission.language.codes import CODES
from mission.language.limits import Limits
from mission.language.quantities import QUANTITIES
from tests.mission.language.missions import MISSIONS, SMALL, line_of, written

V80 = str(MISSIONS / "v80_blade.yaml")


def output(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str]:
    code = main(list(arguments))
    captured = capsys.readouterr()
    assert "Traceback" not in captured.out + captured.err
    return code, captured.out


def test_a_good_mission_is_confirmed_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    code, out = output(capsys, "validate", V80)
    assert code == 0 and out.startswith(f"{V80}: ok, ") and out.count("\n") == 1


def test_findings_are_printed_as_compilers_do_as_json_and_as_annotations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SMALL.replace("timeout_s: 60, on: {done: home", "timeout: 60, on: {done: hoem")
    path = str(written(tmp_path, text))
    line = line_of(text, "hoem")
    code, out = output(capsys, "validate", path)
    assert code == 2
    lines = out.splitlines()
    assert [found.split(" ")[1] for found in lines] == ["M202", "M212", "M301"]
    assert lines[0].startswith(f"{path}:{line}:") and "did you mean timeout_s?" in lines[0]
    assert "did you mean home?" in lines[1]
    code, out = output(capsys, "validate", "--json", path)
    assert code == 2 and [found["line"] for found in json.loads(out)] == [line, line, line + 1]
    code, out = output(capsys, "validate", "--github", path)
    assert code == 2 and out.splitlines()[0].startswith(f"::error file={path},line={line},col=")


def test_an_annotation_s_file_cannot_be_taken_for_its_other_properties() -> None:
    from mission.language.diagnostics import Diagnostic
    from mission.language.location import Location

    said = Diagnostic(Location("a,line=9:b\n::c.yaml", 1, 2), "M203", "100 % wrong").as_annotation()
    assert said == "::error file=a%2Cline=9%3Ab\\n%3A%3Ac.yaml,line=1,col=2,title=M203::M203 100 %25 wrong"


def test_scenario_files_can_be_validated_like_missions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert output(capsys, "validate", str(MISSIONS / "scenarios" / "square.scenario.yaml"))[0] == 0
    path = written(tmp_path, "mission: small.yaml\nscenarios: {a: [{stat: home}]}\n", "small.scenario.yaml")
    written(tmp_path, SMALL)
    code, out = output(capsys, "validate", str(path))
    assert code == 2 and ":2:18: M501" in out and "did you mean state?" in out


def test_warnings_do_not_stop_a_flight_unless_asked_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(written(tmp_path, SMALL.replace("initial: pre", "parameters: {unused_m: 1}\ninitial: pre")))
    assert output(capsys, "validate", path)[0] == 0
    assert output(capsys, "validate", "--strict", path)[0] == 2


def test_the_resolved_mission_is_itself_a_mission(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = output(capsys, "validate", "--resolved", V80, "--set", "turbine.azimuth_deg=90")
    assert code == 0
    path = tmp_path / "resolved.yaml"
    path.write_text(out)
    assert output(capsys, "validate", str(path))[0] == 0
    assert output(capsys, "validate", "--resolved", str(path))[1] == out


def test_every_word_of_the_language_is_listed_with_its_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    expected = {
        "behaviours": behaviours(),
        "events": EVENTS,
        "conditions": QUANTITIES,
        "codes": CODES,
        "limits": [f"limits.{name}" for name in Limits.model_fields],
        "monitors": [event.name for event in EVENTS.values() if event.raised_by == "monitor"],
    }
    for what, names in expected.items():
        code, out = output(capsys, "list", what, "--json")
        listed = {entry["name"]: entry for entry in json.loads(out)}
        assert code == 0 and set(names) <= set(listed)
        assert all(entry["text"] for entry in listed.values()), what
        for entry in listed.values():
            assert all(part["text"] for part in entry["parts"]), (what, entry["name"])
        assert output(capsys, "list", what)[0] == 0


def test_a_proof_is_printed_and_a_failed_one_shows_its_trace(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out = output(capsys, "prove", V80, "--traces")
    assert code == 0 and out.rstrip().endswith("proven") and "FAILS" not in out
    path = written(tmp_path, SMALL.replace("done: home, abort: land", "done: home, abort: aborted"))
    code, out = output(capsys, "prove", str(path))
    assert code == 1 and "M401 airborne" in out and "too_close → aborted" in out and "NOT proven" in out
    code, out = output(capsys, "prove", "--json", str(path))
    assert code == 1 and not json.loads(out)[0]["proven"]
    assert main(["prove", str(written(tmp_path, "mission: [", "broken.yaml"))]) == 2


def test_a_diagram_is_written_where_it_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, start in (("a.svg", "<svg"), ("a.mmd", "flowchart")):
        assert output(capsys, "graph", V80, "-o", str(tmp_path / name))[0] == 0
        assert (tmp_path / name).read_text().startswith(start)
    assert output(capsys, "graph", V80)[1].startswith("<svg")
    assert main(["graph"]) == 2 and main(["graph", "nothing.yaml"]) == 2


def test_validating_imports_nothing_heavy() -> None:
    heavy = (
        "cv2",
        "numpy",
        "numba",
        "scipy",
        "filterpy",
        "mavsdk",
        "pymavlink",
        "rich",
        "transitions",
        "matplotlib",
        "structlog",
    )
    program = (
        f"import sys; from mission.cli.main import main; code = main(['validate', {V80!r}]);"
        f"found = [name for name in {heavy!r} if name in sys.modules]; assert not found, found; sys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
