"""Speaking to a run that is being flown: which one is meant, and what it answers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mission.cli.errors import ABORTED, USAGE, CommandError

if TYPE_CHECKING:
    from mission.executive.operator import Answer


def reach(command: str, run: Path | None, logs: Path, **about: Any) -> Answer:
    """Send a command to the run that is named, or to the only one that flies.

    Raises:
        CommandError: none flies, several do, or it does not answer.
    """
    from mission.executive.operator import OperatorError, tell

    try:
        return tell(_folder(run, logs), command, **about)
    except OperatorError as error:
        raise CommandError(f"{command}: {error}", USAGE) from None


def say(command: str, run: Path | None, logs: Path, **about: Any) -> None:
    """Send a command and print the answer.

    Raises:
        CommandError: as `reach`, or the run will not follow.
    """
    answer = reach(command, run, logs, **about)
    if not answer.done:
        raise CommandError(f"{command}: {answer.text}", ABORTED)
    print(answer.text)


def _folder(run: Path | None, logs: Path) -> Path:
    from mission.executive.operator import flying
    from mission.record.folder import open_run

    if run is not None:
        return open_run(run, logs).path
    found = flying(logs)
    if len(found) == 1:
        return found[0]
    if not found:
        raise CommandError(f"{logs}: no run is being flown (name its folder, or --record DIR)")
    names = ", ".join(folder.name for folder in found)
    raise CommandError(f"{logs}: {len(found)} runs are being flown, name one: {names}")
