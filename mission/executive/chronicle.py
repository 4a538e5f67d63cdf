"""What the executive tells the journal: its beginning, every event and transition, what was found out, and its end."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mission.executive.journal import FORMAT, Journal
from mission.executive.queue import Queued
from mission.language.document import Mission
from mission.language.semantics import Configuration, Quantities, Step

if TYPE_CHECKING:
    from mission.executive.clock import Clock
    from mission.executive.services import Memory, Services


STATION_STEP_M = 1.0  # the journal is told anew where along the blade it is after so many metres


class Chronicle:
    """Writes one run's journal. What behaviours found out goes with the transition that it led to, in one line."""

    def __init__(self, journal: Journal, clock: Clock, mission: Mission, services: Services) -> None:
        self.journal = journal
        self._clock, self._mission, self._services = clock, mission, services
        self._told: Memory | None = None
        self._station_m: float | None = None

    def begins(self, configuration: Configuration, *, autonomy: str, resumed: bool) -> None:
        """The first line; of a run that goes on with another, with what is known from there."""
        memory = self._news() if resumed else None
        self._line(
            "start",
            mission=self._mission.name,
            version=self._mission.version,
            format=FORMAT,
            autonomy=autonomy,
            resumed=resumed,
            state=configuration.leaf,
            history=configuration.history,
            taken=configuration.taken,
            **({} if memory is None else {"memory": memory}),
        )

    def happened(self, queued: Queued, led_to: str, state: str, quantities: Quantities) -> None:
        """An event and what becomes of it, with the quantities that the guards asked for."""
        guards = {
            name: quantities.get(name)
            for transition in self._mission.handlers(queued.origin or state, queued.name)
            for condition in (transition.when, transition.unless)
            if condition is not None
            for name in condition.names
        }
        about = {
            "origin": queued.origin,
            "only": queued.only.key if queued.only else None,
            "confirmed": queued.confirmed or None,
            "data": queued.data or None,
            "guards": guards or None,
        }
        given = {name: value for name, value in about.items() if value is not None}
        self._line("event", soon=led_to == "transition", event=queued.name, state=state, led_to=led_to, **given)

    def steps(self, step: Step) -> None:
        """A transition that is about to be made."""
        memory = self._news()
        self._line(
            "transition",
            event=step.event,
            by=step.transition.event,
            key=step.transition.key,
            **{"from": step.source, "to": step.after.leaf},
            history=step.after.history,
            taken=step.after.taken,
            **({} if memory is None else {"memory": memory}),
        )

    def found_out(self, state: str) -> None:
        """What behaviours have found out since, and how far along the blade they are."""
        memory = self._news()
        if memory is not None:
            self._line("memory", **memory)
        station = self._services.progress.station_m
        if station is not None and (self._station_m is None or abs(station - self._station_m) >= STATION_STEP_M):
            self._station_m = round(station, 1)
            self._line("progress", state=state, station_m=self._station_m)

    def acts(self, command: str, who: str, *, soon: bool = False, **about: Any) -> None:
        """What an operator did. `soon`: a line about what it leads to follows at once."""
        self._line("operator", soon=soon, command=command, who=who, **about)

    def fails(self, error: Exception) -> None:
        """An error of the executive itself."""
        self._line("fault", error=f"{type(error).__name__}: {error}"[:300])

    def ends(self, outcome: str, state: str, why: str | None = None) -> None:
        """The last line. why: what ended the run where no transition did."""
        self.found_out(state)
        lost = {"lost": self.journal.lost} if self.journal.lost else {}
        self._line("end", outcome=outcome, state=state, **({} if why is None else {"why": why}), **lost)

    def _line(self, kind: str, **fields: Any) -> None:
        self.journal.append(kind, self._clock.now(), **fields)

    def _news(self) -> Mapping[str, Any] | None:
        memory = self._services.memory
        if memory == self._told:
            return None
        self._told = deepcopy(memory)
        return asdict(memory)
