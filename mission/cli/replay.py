"""The run again from its record: the same events through the same machine."""

from __future__ import annotations

import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from mission.executive.replay import Played
    from mission.language.document import Mission


def replay(
    run: Annotated[Path, typer.Argument(help="The run's folder, name, or `latest`.")],
    speed: Annotated[
        float | None, typer.Option(min=0.01, help="Mission seconds per wall second; without it, as fast as it goes.")
    ] = None,
    begin: Annotated[float, typer.Option("--from", metavar="SECONDS", help="Show nothing before this time.")] = 0.0,
    step: Annotated[bool, typer.Option("--step", help="Wait for Enter, or a line of input, after every line.")] = False,
    mission: Annotated[
        Path | None, typer.Option(help="Play it through another mission file: does a change alter what happens?")
    ] = None,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
) -> None:
    """Play the recorded events through the same machine and report the first difference, if there is any.

    A run that goes on with others is played after them.

    \b
    Examples:
      mission replay latest
      mission replay 20261121T101500Z-v80_blade --speed 10 --from 60
      mission replay latest --mission missions/v80_blade.yaml

    Exit code 0 when everything happened as recorded, 1 at a difference.
    """
    from mission.cli.errors import ABORTED, USAGE, CommandError
    from mission.executive.resume import ResumeError
    from mission.language.document import load
    from mission.record.folder import open_run
    from mission.record.lineage import lineage

    folder = open_run(run, record)
    document = load(mission or folder.mission)
    for part in lineage(folder):
        if part != folder and not part.journal.exists():
            continue  # it was cut off before its first decision
        try:
            difference, events, transitions, whole = _play(part.journal, document, speed, begin, step)
        except ResumeError as error:
            raise CommandError(str(error), USAGE) from None
        if difference is not None:
            raise CommandError(difference, ABORTED)
        so_far = "" if whole else " so far: the input ended"
        print(f"{part.name}: {events} events, {transitions} transitions, all as recorded{so_far}")
        if not whole:
            return


def _play(
    journal: Path, document: Mission, speed: float | None, begin: float, step: bool
) -> tuple[str | None, int, int, bool]:
    """The first difference, how many events and transitions were played, and whether that is all of them."""
    import asyncio

    from mission.executive.replay import replay

    events = transitions = 0
    before = begin
    with asyncio.Runner() as runner:  # entered for each line: a person is waited for outside, where Ctrl-C is heard
        recorded = replay(journal, document)
        while (played := runner.run(_next(recorded))) is not None:
            if played.difference is not None:
                return f"{journal}:{played.line}: {played.event}: {played.difference}", events, transitions, True
            if played.step is None and played.led_to == "transition":
                continue
            events += 1
            transitions += played.step is not None
            if played.t < begin:
                continue
            if speed is not None:
                time.sleep(max(played.t - before, 0.0) / speed)
                before = played.t
            where = f"→ {played.state}" if played.step is not None else f"({played.led_to} in {played.state})"
            print(f"{played.t:9.2f} s  {played.event:20} {where}", flush=True)
            if step and not sys.stdin.readline():
                return None, events, transitions, False
    return None, events, transitions, True


async def _next(recorded: AsyncIterator[Played]) -> Played | None:
    return await anext(recorded, None)
