"""Scenario files pass and fail for the right reasons, at the right lines, in `mission test` and in pytest."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mission.cli.main import main
from mission.language.scenario_report import Report, find, report
from tests.mission.language.missions import MISSIONS, SMALL, line_of, written

pytest_plugins = ["pytester"]

GOOD = """\
mission: small.yaml
scenarios:
  all goes well:
    - {state: preflight, does: check_vehicle}
    - passed: launch
    - {event: done, state: work, does: hold, with: {for_s: 5}}
    - {event: link_restored, ignored: true, state: work}
    - {wait_s: 60.5, state: land}
    - {event: landed, states: [aborted], outcome: aborted}
"""


def reported(tmp_path: Path, text: str) -> Report:
    written(tmp_path, SMALL)
    path = tmp_path / "missions" / "small.scenario.yaml"
    path.write_text(text)
    return report(path)


def test_a_good_scenario_passes_and_its_coverage_is_counted(tmp_path: Path) -> None:
    result = reported(tmp_path, GOOD)
    assert result.passed and result.coverage is not None
    assert result.coverage.states == (5, 10) and result.coverage.transitions == (4, 16)


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [
        ("passed: launch", "passed: work", "state is 'launch', not 'work'"),
        ("does: hold, with: {for_s: 5}", "does: land", "does is 'hold'"),
        ("for_s: 5", "for_s: 6", "for_s"),
        ("wait_s: 60.5", "wait_s: 59.5", "state is 'work'"),
        ("ignored: true", "ignored: false", "ignored is True"),
        ("states: [aborted]", "states: [land, aborted]", "states is ['aborted']"),
        ("outcome: aborted", "outcome: completed", "outcome is 'aborted'"),
        ("passed: launch", "found: launch", "cannot happen in 'preflight'"),
    ],
)
def test_what_does_not_go_as_expected_fails_at_its_line(tmp_path: Path, before: str, after: str, word: str) -> None:
    text = GOOD.replace(before, after)
    result = reported(tmp_path, text)
    assert [finding.code for finding in result.findings] == ["M502"]
    assert result.findings[0].location.line == line_of(text, after) and word in result.findings[0].message


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("mission: small.yaml", "mission: smal.yaml"),
        ("state: preflight", "stat: preflight"),
        ("wait_s: 60.5", "wait_s: long"),
        ("wait_s: 60.5", "wait_s: .inf"),
        ("wait_s: 60.5", "wait_s: .nan"),
        ("wait_s: 60.5", "wait_s: -1"),
        ("wait_s: 60.5", "wait_s: 1e300"),
        ("wait_s: 60.5", "given: {battery_percent: low}"),
        ("wait_s: 60.5", "given: {battery_percent: .nan}"),
        ("passed: launch", "passed launch"),
        ("ignored: true", "ignored: maybe"),
        ("passed: launch", "passed: launhc"),
        ("state: work, does", "state: wrok, does"),
        ("does: hold", "does: hodl"),
        ("for_s: 5", "fro_s: 5"),
        ("states: [aborted]", "states: [abroted]"),
        ("outcome: aborted", "outcome: abroted"),
        ("scenarios:", "scenarois:"),
    ],
)
def test_a_wrong_scenario_file_is_reported_and_not_run(tmp_path: Path, before: str, after: str) -> None:
    result = reported(tmp_path, GOOD.replace(before, after))
    assert result.file is None and result.findings
    assert line_of(GOOD, before) in {finding.location.line for finding in result.findings}


def test_completeness_names_what_is_left_out(tmp_path: Path) -> None:
    result = reported(tmp_path, "coverage: complete\n" + GOOD)
    assert [finding.code for finding in result.findings] == ["M503"]
    assert "the state home" in result.findings[0].message and "work: done → home" in result.findings[0].message


@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_mission_has_scenarios_that_cover_it(path: Path) -> None:
    files = find(path)
    assert files
    for file in files:
        result = report(file)
        assert result.passed, [str(finding) for finding in result.findings]
    assert any(result.coverage is not None and result.coverage.complete for result in map(report, files))


def test_the_command_tells_passed_failed_and_unreadable_apart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reported(tmp_path, GOOD)
    path = str(tmp_path / "missions" / "small.yaml")
    assert main(["test", path]) == 0 and "1 of 1 scenarios passed" in capsys.readouterr().out
    reported(tmp_path, GOOD.replace("passed: launch", "passed: work"))
    assert main(["test", path, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)[0]["findings"][0]["code"] == "M502"
    reported(tmp_path, GOOD.replace("scenarios:", "scenarois:"))
    assert main(["test", path]) == 2
    assert main(["test", str(MISSIONS / "turbines")]) == 2


def test_pytest_collects_scenario_files_by_their_name(pytester: pytest.Pytester, tmp_path: Path) -> None:
    reported(tmp_path, "coverage: complete\n" + GOOD.replace("outcome: aborted", "outcome: completed"))
    outcome = pytester.runpytest_inprocess("-p", "no:cacheprovider", "-p", "no:xdist", str(tmp_path / "missions"))
    outcome.assert_outcomes(failed=2)
    outcome.stdout.fnmatch_lines(["*small.scenario.yaml:10:*M502*outcome is 'aborted'*", "*M503*left out*"])


def test_what_cannot_be_tested_is_said_also_beside_what_passes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reported(tmp_path, GOOD)
    good = str(tmp_path / "missions" / "small.yaml")
    written(tmp_path, SMALL, "untested.yaml")
    for name, word in (("gone.yaml", "there is no"), ("untested.yaml", "no scenarios for")):
        assert main(["test", good, str(tmp_path / "missions" / name)]) == 2
        assert word in capsys.readouterr().err
