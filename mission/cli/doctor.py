"""Is this machine, rig and vehicle ready."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission.cli.errors import ABORTED

if TYPE_CHECKING:
    from mission.cli.checkup import Check

DEFAULT_MISSION = Path("missions/v80_blade.yaml")


def doctor(
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="The mission that is to be flown.")] = None,
    rig: Annotated[str | None, typer.Option(help="Its rig file, if another one.")] = None,
    system: Annotated[
        str | None, typer.Option(metavar="URL", help="Where the vehicle is, such as udpin://0.0.0.0:14540.")
    ] = None,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
) -> None:
    """Look at this machine, the mission's rig and its vehicle, and say what is not as it should be.

    \b
    Examples:
      mission doctor
      mission doctor missions/v80_blade.yaml --rig missions/rigs/px4_sitl.yaml

    Exit code 0 where a flight could start, 1 where something is bad.
    """
    from mission.cli.checkup import Level

    levels = []
    for check in _checks(file, rig, system, record):
        levels.append(check.level)
        remedy = f"  → {check.remedy}" if check.level is not Level.OK and check.remedy else ""
        typer.echo(f"{_mark(check)} {check.name:<10} {check.found}{remedy}")
    bad = levels.count(Level.BAD)
    print("ready to fly" if not bad else f"not ready: {bad} of {len(levels)} checks failed")
    raise typer.Exit(ABORTED if bad else 0)


def _mark(check: Check) -> str:
    sign, colour = {"ok": ("ok  ", "green"), "warning": ("warn", "yellow"), "bad": ("BAD ", "red")}[check.level]
    return typer.style(sign, fg=colour, bold=True)


def _checks(file: Path | None, rig: str | None, system: str | None, record: Path) -> Iterator[Check]:
    from mission.cli import checkup

    yield from checkup.machine(record)
    if file is None and not DEFAULT_MISSION.is_file():
        return
    from mission.executive.belief import rig_geometry
    from mission.language.document import load

    mission = load(file or DEFAULT_MISSION, (), rig)
    standoff_m = mission.parameters.get("standoff_m", 3.0)
    folder = Path(rig).parent if rig else mission.path.parent
    yield from checkup.rig(mission, rig_geometry(mission.rig, folder), standoff_m)
    yield from _vehicle(system or mission.rig.system)


def _vehicle(system: str) -> Iterator[Check]:
    import asyncio

    from mission.cli import checkup

    if system == "embedded":
        yield checkup.Check("vehicle", checkup.Level.OK, "the embedded simulator starts with each run")
        return
    port = checkup.port(system)
    yield port
    if port.level is checkup.Level.OK:
        yield asyncio.run(checkup.vehicle(system))
