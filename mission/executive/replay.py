"""A run again from its record: the events that were journalled, played through the same machine."""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mission.executive.decision import autonomy_after, decide
from mission.executive.events import EventError, event
from mission.executive.journal import Entry, JournalError, read_journal
from mission.executive.machine import Machine
from mission.executive.machine import entries as skips
from mission.executive.queue import Queued
from mission.executive.resume import check_format
from mission.language.semantics import Configuration, Step

if TYPE_CHECKING:
    from mission.executive.decision import Autonomy
    from mission.language.document import Mission, Transition


@dataclass(frozen=True)
class Played:
    """One recorded line, played. line: its number in the journal, from 1. state: the leaf after it. difference: what
    this program does otherwise, None where it does the same."""

    line: int
    t: float
    event: str
    state: str
    led_to: str
    step: Step | None = None
    difference: str | None = None


async def replay(journal: Path, mission: Mission) -> AsyncIterator[Played]:
    """Play a run's events, each as it is asked for, up to the first difference.

    Raises:
        JournalError: there is no journal, or it is damaged.
        ResumeError: it was written in another format.
    """
    recorded = read_journal(journal)
    if not recorded:
        return
    check_format(journal, recorded)
    player = _Player(mission, recorded[0])
    expected: Step | None = None
    for line, entry in enumerate(recorded, 1):
        if entry.kind == "event":
            played, expected = await player.happen(line, entry)
        elif entry.kind == "transition":
            played = player.compare(line, entry, expected)
            expected = None
        else:
            continue
        yield played
        if played.difference is not None:
            return


class _Player:
    def __init__(self, mission: Mission, start: Entry) -> None:
        fields = start.fields
        self.mission = mission
        self.autonomy: Autonomy = fields.get("autonomy", "full")
        history, taken = dict(fields.get("history", {})), dict(fields.get("taken", {}))
        state = str(fields.get("state"))
        if state not in mission.states:
            raise JournalError(f"the record begins in {state!r}, a state that its mission does not have")
        self.machine = Machine(mission, Configuration(state, history, taken))
        self.transitions: dict[str, Transition] = {
            entry.key: entry for entry in (*mission.transitions(), *skips(mission).values())
        }

    async def happen(self, line: int, entry: Entry) -> tuple[Played, Step | None]:
        """Decide what a recorded event leads to, and let it happen."""
        fields = entry.fields
        name, was = str(fields["event"]), str(fields.get("led_to"))

        def played(difference: str | None = None, step: Step | None = None) -> tuple[Played, Step | None]:
            return Played(line, entry.t, name, self.machine.state, was, step, difference), step

        if fields.get("state") != self.machine.state:
            return played(f"recorded in {fields.get('state')}, now in {self.machine.state}")
        if was in ("stale", "confirmation"):
            return played()
        key = fields.get("only")
        only = None if key is None else self.transitions.get(str(key))
        if key is not None and only is None:
            return played(f"the mission has no transition {key} any more")
        queued = Queued(
            0, 0, name, fields.get("data", {}), None, fields.get("origin"), only, bool(fields.get("confirmed"))
        )
        guards: dict[str, Any] = dict(fields.get("guards", {}))
        try:
            event(name)
        except EventError as error:
            return played(str(error))
        decision = decide(self.mission, self.machine.configuration, queued, guards, self.autonomy)
        if decision.led_to != was:
            return played(f"recorded as {was}, now {decision.led_to}")
        if decision.led_to != "transition" or decision.transition is None:
            return played()
        step = await self.machine.take(name, guards, queued.origin, decision.transition)
        self.autonomy = autonomy_after(decision.transition, self.autonomy)
        return played(step=step)

    def compare(self, line: int, entry: Entry, step: Step | None) -> Played:
        """Hold a recorded transition against the one that has just been played."""
        fields = entry.fields
        recorded = (fields.get("key"), fields.get("from"), fields.get("to"))
        now = None if step is None else (step.transition.key, step.source, step.after.leaf)
        difference = None
        if now is None:
            difference = f"recorded {recorded[1]} → {recorded[2]} by {recorded[0]}, now no transition"
        elif recorded != now:
            difference = f"recorded {recorded[1]} → {recorded[2]} by {recorded[0]}, now {now[1]} → {now[2]} by {now[0]}"
        return Played(line, entry.t, str(fields.get("event")), self.machine.state, "transition", None, difference)
