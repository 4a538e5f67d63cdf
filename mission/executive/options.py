"""What a flight is asked to do, and what is told of it when it has ended."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mission.executive.decision import Autonomy
    from mission.executive.executive import Executive
    from mission.language.document import Mission
    from mission.record.folder import RunFolder


@dataclass(frozen=True)
class FlightOptions:
    """What `mission run` was asked to do, checked and typed.

    speed, system: None for the rig file's. must_confirm: whether a person is asked before the vehicle is armed, as
    `connection.must_confirm` decides. confirm: how, also before marked transitions with autonomy below full.
    on_start: called with the executive once it exists, for the live view. resume: the
    folder of an interrupted run to go on with.
    """

    mission: Mission
    folder: RunFolder
    speed: float | None = None
    lockstep: bool = False
    system: str | None = None
    must_confirm: bool = True
    autonomy: Autonomy = "full"
    confirm: Callable[[str], bool] = lambda question: False
    on_start: Callable[[Executive], None] = lambda executive: None
    resume: Path | None = None


@dataclass(frozen=True)
class FlightResult:
    """How the flight ended: the final state's outcome, its path, and whether a person or a signal interrupted it."""

    outcome: str
    final_state: str
    interrupted: bool
