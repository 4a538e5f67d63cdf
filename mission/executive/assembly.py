"""Puts a flight together: world or hardware, autopilot, vision, record, executive; flies it; takes it apart again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mission.executive.executive import Executive
    from mission.language.document import Mission
    from mission.record.folder import RunFolder


@dataclass(frozen=True)
class FlightOptions:
    """What `mission run` was asked to do, checked and typed.

    speed: None for the rig file's. system: None for the rig file's. confirm: asked before a real vehicle is armed and, with
    autonomy below full, before marked transitions. on_start: called with the executive once it exists (for the live view).
    resume: the folder of an interrupted run to go on with.
    """

    mission: Mission
    folder: RunFolder
    speed: float | None = None
    lockstep: bool = False
    system: str | None = None
    autonomy: str = "full"
    confirm: Callable[[str], bool] = lambda question: False
    on_start: Callable[[Executive], None] = lambda executive: None
    resume: Path | None = None


@dataclass(frozen=True)
class FlightResult:
    """How the flight ended: the final state's outcome, its path, and whether a person or a signal interrupted it."""

    outcome: str
    final_state: str
    interrupted: bool


class FlightError(RuntimeError):
    """The flight could not begin; one line for a person."""


def fly(options: FlightOptions) -> FlightResult:
    """Fly a mission and write its record (everything except summary and report) into the run's folder.

    Blocks until the machine is in a final state. SIGINT and SIGTERM run the mission's abort path.

    Raises:
        FlightError: nothing was flown (no connection, port in use, rig not there), one line with the remedy.
    """
    raise NotImplementedError
