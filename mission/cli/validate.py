"""Check mission files as a compiler would."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from mission.language.loading import Examination


def validate(
    files: Annotated[list[Path], typer.Argument(help="Mission files.")],
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Override a value of the resolved mission; repeat it."),
    ] = None,
    rig: Annotated[str | None, typer.Option(help="Another rig file.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="All findings as JSON.")] = False,
    github: Annotated[bool, typer.Option("--github", help="Findings as annotations of a GitHub pull request.")] = False,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings count as errors.")] = False,
    resolved: Annotated[
        bool, typer.Option("--resolved", help="Print the resolved mission: files, references and overrides applied.")
    ] = False,
) -> None:
    """Check missions: names, types, limits, references; and whether the machine always ends, and ends safely.

    Every finding is one line, file:line:column: CODE message. docs/codes explains each code. A code that may be
    silenced is, by a comment on its line that says why:  land: {…}  # allow: M305, it is asked to land until it has
    Scenario files are checked as well.

    \b
    Examples:
      mission validate missions/*.yaml
      mission validate missions/v80_blade.yaml --set turbine.azimuth_deg=180 --resolved
      mission validate --github missions/*.yaml
    """
    from mission.language.codes import Level
    from mission.language.diagnostics import json_report

    examinations = [(file, _examined(file, changes or [], rig)) for file in files]
    findings = [finding for _, examination in examinations for finding in examination.diagnostics]
    if as_json:
        print(json_report(findings))
    else:
        for finding in findings:
            print(finding.as_annotation() if github else finding)
    for file, examination in examinations:
        mission = examination.mission
        if mission is None or as_json or github:
            continue
        if resolved:
            print(mission.resolved_yaml, end="")
        else:
            print(f"{file}: ok, {len(mission.states)} states, {len(mission.transitions())} transitions")
    if any(finding.level is Level.ERROR or strict for finding in findings):
        raise typer.Exit(2)


def _examined(file: Path, changes: list[str], rig: str | None) -> Examination:
    """A mission, or a file of scenarios by its name."""
    from mission.language.loading import Examination, examine

    if not file.name.endswith(".scenario.yaml"):
        return examine(file, changes, rig)
    from mission.language.scenario_in import read

    scenarios, findings = read(file)
    return Examination(scenarios.mission if scenarios is not None else None, findings)
