"""Answer the question that a running mission waits with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def step(
    run: Annotated[Path | None, typer.Argument(help="The run's folder or name; without it the one that flies.")] = None,
    no: Annotated[bool, typer.Option("--no", help="Do not take the transition; the vehicle holds.")] = False,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
) -> None:
    """Take the transition that waits for a yes, in a run flown with --autonomy confirm or manual.

    \b
    Examples:
      mission step
      mission step --no
    """
    from mission.cli.command import say

    say("step", run, record, yes=not no)
