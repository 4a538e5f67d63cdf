"""Go to a state that the running mission marks as an entry."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def skip(
    state: Annotated[str, typer.Argument(help="Path of the state, such as inspect.blade.trailing.")],
    run: Annotated[Path | None, typer.Argument(help="The run's folder or name; without it the one that flies.")] = None,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
) -> None:
    """Leave the present state for one that the mission marks with `entry: true`.

    \b
    Example:
      mission skip inspect.blade.trailing
    """
    from mission.cli.command import say

    say("skip", run, record, target=state)
