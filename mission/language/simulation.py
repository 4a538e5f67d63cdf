"""A mission without vehicle, cameras or waiting: events in, states out, on a simulated clock.

    flight = simulate("missions/v80_blade.yaml", at="inspect.blade.leading")
    flight.happens("vision_lost")
    assert flight.state == "inspect.reacquire"

The rules are the executive's own: `semantics`, what becomes of an event, and what is due when.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mission.executive.decision import decide
from mission.executive.events import EVENTS, outcomes
from mission.executive.queue import Queued
from mission.executive.timing import Timing, Waiting
from mission.language import semantics
from mission.language.diagnostics import near_or_choices
from mission.language.document import Mission, Transition, enclosing, load
from mission.language.happening import behaviour_of, outcomes_of
from mission.language.semantics import Configuration, Step


class SimulationError(ValueError):
    """Something that cannot happen was asked for; one line for a person."""


@dataclass(frozen=True)
class Happening:
    """What became of one event. step: None where nothing answered it, or where its transition is still delayed."""

    at_s: float
    event: str
    origin: str
    step: Step | None
    delayed_s: float = 0.0


class Simulation:
    """One run. `quantities` are what guards read; they stay as they were given until changed."""

    def __init__(self, mission: Mission, at: str | None = None, **quantities: float | bool | None) -> None:
        """Begin where the mission begins, or in a state (entered as if from outside).

        Raises:
            SimulationError: the state does not exist.
        """
        self.mission = mission
        self.now_s = 0.0
        self.quantities: dict[str, float | bool | None] = dict(quantities)
        self.happenings: list[Happening] = []
        self.entered: list[str] = []
        self.taken: list[str] = []
        self._timing = Timing()
        if at is not None and at not in mission.states:
            raise SimulationError(f"there is no state {at!r} ({near_or_choices(at, mission.states)})")
        leaf = mission.leaf(at) if at is not None else semantics.start(mission).leaf
        self.configuration = Configuration(leaf)
        paths = tuple(reversed(tuple(enclosing(leaf))))
        self.entered += paths
        self._timing = self._timing.entering(mission, paths, 0.0)

    @property
    def state(self) -> str:
        """Path of the active leaf."""
        return self.configuration.leaf

    @property
    def outcome(self) -> str | None:
        """How the mission ended, None while it goes on."""
        return semantics.ended(self.mission, self.configuration)

    @property
    def does(self) -> str | None:
        """The behaviour that would run now."""
        return self.mission.states[self.state].do

    @property
    def parameters(self) -> dict[str, Any]:
        """What that behaviour is told."""
        parameters = self.mission.states[self.state].parameters
        return {} if parameters is None else parameters.model_dump()

    def happens(self, event: str, *, within: str | None = None, **quantities: float | bool | None) -> Simulation:
        """Let an event happen now; returns the simulation, so that calls can be chained.

        within: the composite that the event is about, for a deadline of its own.

            Raises: SimulationError: there is no such event, the running behaviour has no such outcome, or the mission
            has ended.
        """
        self._may_happen(event, within)
        self.quantities |= quantities
        self._handle(self._queued(event, within))
        return self

    def wait(self, seconds: float) -> Simulation:
        """Let time pass: deadlines and delayed transitions come in their order."""
        end = self.now_s + seconds
        while self.outcome is None and (due_s := self._timing.next_s()) is not None and due_s <= end:
            self.now_s = due_s
            late, ripe = self._timing.overdue(due_s), self._timing.due(due_s)
            if late is not None:
                self._timing = self._timing.expired(late)
                self._handle(self._queued("timed_out", late))
            elif ripe is not None:
                self._timing = self._timing.without(ripe)
                self._handle(self._queued(ripe.event, only=ripe.transition))
        self.now_s = end
        return self

    def _may_happen(self, event: str, within: str | None) -> None:
        if self.outcome is not None:
            raise SimulationError(f"{event!r} cannot happen: the mission has ended in {self.state!r}")
        known = [*EVENTS, *outcomes()]
        if event not in known:
            raise SimulationError(f"there is no event {event!r} ({near_or_choices(event, known)})")
        if within is not None and within not in self.configuration.active:
            raise SimulationError(f"{within!r} is not active: the mission is in {self.state!r}")
        behaviour = behaviour_of(self.mission.states[self.state])
        can = outcomes_of(self.mission.states[self.state])
        if event not in EVENTS and event not in can:
            does = f"{behaviour.name} ends with {', '.join(can)}" if behaviour is not None else "it does nothing"
            raise SimulationError(f"{event!r} cannot happen in {self.state!r}: {does}")

    def _queued(self, event: str, origin: str | None = None, only: Transition | None = None) -> Queued:
        return Queued(0, 0, event, origin=origin, only=only)

    def _handle(self, queued: Queued) -> None:
        decision = decide(self.mission, self.configuration, queued, self.quantities, "full")
        origin = queued.origin or self.state
        if decision.led_to == "delayed" and decision.transition is not None:
            waiting = Waiting(self.now_s + decision.delay_s, queued.name, decision.transition)
            self._timing = self._timing.delaying(waiting)
        if decision.led_to != "transition" or decision.transition is None:
            self.happenings.append(Happening(self.now_s, queued.name, origin, None, decision.delay_s))
            return
        step = semantics.take(self.mission, self.configuration, decision.transition, queued.name)
        self.configuration = step.after
        self._timing = self._timing.stepping(self.mission, step, self.now_s)
        self.entered += step.entered
        self.taken.append(decision.transition.key)
        self.happenings.append(Happening(self.now_s, queued.name, origin, step))


def simulate(
    mission: Mission | Path | str,
    at: str | None = None,
    overrides: Sequence[str] = (),
    quantities: Mapping[str, float | bool | None] | None = None,
) -> Simulation:
    """A simulation of a mission or a mission file.

    Raises:
        MissionFileError: the file is wrong. SimulationError: there is no such state.
    """
    loaded = mission if isinstance(mission, Mission) else load(mission, overrides)
    return Simulation(loaded, at, **dict(quantities or {}))
