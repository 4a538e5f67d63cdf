"""Hold the vehicle of a running mission where it is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def pause(
    run: Annotated[Path | None, typer.Argument(help="The run's folder or name; without it the one that flies.")] = None,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
) -> None:
    """Hold position, laser off, until `mission resume`. The battery, the wind and everything else stay watched.

    \b
    Example:
      mission pause
    """
    from mission.cli.command import say

    say("pause", run, record)
