"""Give a running mission up: back off, climb clear, go home, land."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def abort(
    run: Annotated[Path | None, typer.Argument(help="The run's folder or name; without it the one that flies.")] = None,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
) -> None:
    """Run the mission's abort path, as Ctrl-C does in the terminal that flies.

    \b
    Examples:
      mission abort
      mission abort 20261121T101500Z-v80_blade
    """
    from mission.cli.command import say

    say("abort", run, record)
