"""Going on with a run: which one, and how it was flown."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from mission.cli.errors import CommandError

if TYPE_CHECKING:
    from mission.record.folder import RunFolder


def interrupted_run(resume: Path | None, logs: Path) -> RunFolder | None:
    """The folder that `--resume` names; None without it.

    Raises:
        CommandError, RunFolderError: it is still being flown, another run goes on with it already, or there is none.
    """
    if resume is None:
        return None
    from mission.executive.operator import flying
    from mission.record.folder import open_run
    from mission.record.lineage import last_of_row

    folder = open_run(resume, logs)
    if folder.path.resolve() in [path.resolve() for path in flying(folder.path.parent)]:
        raise CommandError(f"run: {folder.name} is still flown: `mission status` shows it, `mission abort` ends it")
    last = last_of_row(folder)
    if last != folder:
        raise CommandError(
            f"run: {folder.name} was gone on with already: give --resume {last.name}, the last of its row"
        )
    return folder


def as_before(
    resumed: RunFolder, speed: float | None, system: str | None, lockstep: bool
) -> tuple[float | None, str | None, bool]:
    """Speed, system and lockstep as that run had them, where nothing else is said now."""
    from mission.record.lineage import note_of

    before = note_of(resumed)
    lockstep = lockstep or (before.lockstep and speed is None and system is None)
    if lockstep:
        return speed, system, True
    return before.speed if speed is None else speed, before.system if system is None else system, False
