"""Runs scenario files for `mission test` and says how they went."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mission.language.diagnostics import Diagnostic
from mission.language.scenario import Coverage, Result, ScenarioFile, coverage_finding
from mission.language.scenario_in import read
from mission.language.sources import shown as shown_path

SUFFIX = ".scenario.yaml"


@dataclass(frozen=True)
class Report:
    """One scenario file. file: None where it could not be read. findings: all that is wrong."""

    path: Path
    file: ScenarioFile | None
    results: tuple[Result, ...]
    coverage: Coverage | None
    findings: tuple[Diagnostic, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        return not self.findings


def find(path: Path) -> tuple[Path, ...]:
    """Scenario files: the path itself, those in a folder, or those that belong to a mission file."""
    if path.name.endswith(SUFFIX):
        return (path,)
    if path.is_dir():
        return tuple(sorted(path.rglob(f"*{SUFFIX}")))
    places = [folder.glob(f"{path.stem}*{SUFFIX}") for folder in (path.parent, path.parent / "scenarios")]
    return tuple(sorted(found for place in places for found in place))


def report(path: Path) -> Report:
    """Read and run one file."""
    file, findings = read(path)
    if file is None:
        return Report(path, None, (), None, findings)
    results = file.run()
    coverage = file.coverage(results)
    wrong = [result.failure for result in results if result.failure is not None]
    missing = coverage_finding(file, coverage)
    return Report(path, file, results, coverage, (*wrong, *([missing] if missing is not None else [])))


def shown(report: Report, verbose: bool = False) -> str:
    """The report as lines."""
    return "\n".join(_lines(report, verbose))


def _lines(report: Report, verbose: bool) -> Iterator[str]:
    for finding in report.findings:
        yield str(finding)
    if report.coverage is None:
        return
    if verbose:
        for result in report.results:
            yield f"  {'passed' if result.failure is None else 'FAILED'}  {result.scenario.name}"
        for left_out in (*report.coverage.missing_states, *report.coverage.missing_transitions):
            yield f"  left out  {left_out}"
    passed = sum(result.failure is None for result in report.results)
    states, transitions = report.coverage.states, report.coverage.transitions
    yield (
        f"{shown_path(report.path)}: {passed} of {len(report.results)} scenarios passed; "
        f"{states[0]} of {states[1]} states, {transitions[0]} of {transitions[1]} transitions"
    )


def data(report: Report) -> dict[str, Any]:
    """For `--json`."""
    coverage = report.coverage
    return {
        "file": shown_path(report.path),
        "passed": report.passed,
        "scenarios": [
            {"name": result.scenario.name, "passed": result.failure is None, "line": result.scenario.location.line}
            for result in report.results
        ],
        "coverage": None
        if coverage is None
        else {
            "states": list(coverage.states),
            "transitions": list(coverage.transitions),
            "left_out": [*coverage.missing_states, *coverage.missing_transitions],
        },
        "findings": [finding.as_json() for finding in report.findings],
    }
