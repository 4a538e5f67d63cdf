"""Run scenario tests: events and expected states, without a vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def test(
    files: Annotated[
        list[Path], typer.Argument(help="Scenario files, missions that have some beside them, or folders.")
    ],
    as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Name scenarios that passed, too.")] = False,
) -> None:
    """Run the scenarios of missions: what happens, and where the mission must be then, on a simulated clock.

    A scenario file is called NAME.scenario.yaml and names its mission; pytest collects it, too. Of a mission file its
    scenarios are sought beside it and in the folder `scenarios` there.

    \b
    Examples:
      mission test missions/v80_blade.yaml
      mission test missions --verbose

    Exit code 1 where a scenario does not go as expected, 2 where a file cannot be read.
    """
    from mission.cli.errors import CommandError
    from mission.language.scenario_report import data, find, report, shown

    found = {file: find(file) for file in files}
    if gone := [str(file) for file in files if not file.exists()]:
        raise CommandError(f"test: there is no {', '.join(gone)}")
    if without := [str(file) for file, paths in found.items() if not paths]:
        raise CommandError(f"test: no scenarios for {', '.join(without)}; write NAME.scenario.yaml")
    reports = [report(path) for path in dict.fromkeys(path for paths in found.values() for path in paths)]
    if as_json:
        import json

        print(json.dumps([data(one) for one in reports], indent=2, ensure_ascii=False))
    else:
        for one in reports:
            print(shown(one, verbose))
    if any(one.file is None for one in reports):
        raise typer.Exit(2)
    if not all(one.passed for one in reports):
        raise typer.Exit(1)
