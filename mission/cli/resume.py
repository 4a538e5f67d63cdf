"""Let a paused mission go on where it was."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def resume(
    run: Annotated[Path | None, typer.Argument(help="The run's folder or name; without it the one that flies.")] = None,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
) -> None:
    """Go on after `mission pause`. A run that was interrupted goes on with `mission run --resume` instead.

    \b
    Example:
      mission resume
    """
    from mission.cli.command import say

    say("resume", run, record)
