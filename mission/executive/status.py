"""What the executive is doing, for people: where it is, for how long still, what may come next and what blocks it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from mission.executive.events import EVENTS
from mission.executive.timing import Timing
from mission.language import semantics
from mission.language.document import Mission, Transition
from mission.language.semantics import Configuration, Quantities


@dataclass(frozen=True)
class Next:
    """A transition that may come. blocked: what holds it back now, None where nothing does. asks: it needs a yes."""

    event: str
    target: str
    blocked: str | None
    asks: bool


@dataclass(frozen=True)
class Recent:
    """An event that was handled. led_to: the state it led to, or what became of it."""

    t: float
    event: str
    led_to: str


@dataclass(frozen=True)
class Status:
    """One glance at a run. Times are mission seconds.

    path: of the active leaf. deadline_s: when the nearest deadline of the active states passes. waiting: the question
    that an operator has to answer. ended: the outcome, once there is one.
    """

    mission: str
    path: str
    now_s: float
    entered_s: float
    deadline_s: float | None
    behaviour: str | None
    next: tuple[Next, ...]
    recent: tuple[Recent, ...]
    autonomy: str
    paused: bool
    waiting: str | None
    let_go: bool
    interrupted: bool
    journal_error: str | None
    ended: str | None
    text: str = ""
    station_m: float | None = None

    @property
    def in_state_s(self) -> float:
        """Time since the state was entered."""
        return self.now_s - self.entered_s


def possible(
    mission: Mission, configuration: Configuration, timing: Timing, quantities: Quantities
) -> tuple[Next, ...]:
    """Every transition of the active states that may answer an event, inner states and outcomes first."""
    owners = [mission.states[path].on for path in configuration.active] + [mission.on]
    transitions = [transition for owner in owners for transition in owner]
    transitions.sort(key=lambda transition: transition.event in EVENTS)
    waiting = {entry.transition.key: entry.due_s for entry in timing.waiting}
    seen: set[str] = set()
    found = []
    for transition in transitions:
        blocked = _blocked(transition, configuration, quantities, waiting.get(transition.key))
        if transition.event in seen:
            continue
        if not transition.guarded and blocked is None:
            seen.add(transition.event)
        target = semantics.entered_leaf(mission, configuration, transition)
        found.append(Next(transition.event, target, blocked, transition.confirm))
    return tuple(found)


def _blocked(
    transition: Transition, configuration: Configuration, quantities: Quantities, due_s: float | None
) -> str | None:
    if semantics.used_up(transition, configuration):
        return f"its {transition.retries} retries are used up"
    if transition.when is not None and not transition.when.evaluate(quantities):
        return f"needs {transition.when}{_values(transition.when.names, quantities)}"
    if transition.unless is not None and transition.unless.evaluate(quantities):
        return f"not while {transition.unless}{_values(transition.unless.names, quantities)}"
    return None if due_s is None else f"waits until {due_s:.1f} s"


def _values(names: tuple[str, ...], quantities: Quantities) -> str:
    known: Mapping[str, float | bool | None] = {name: quantities.get(name) for name in names}
    shown = ", ".join(f"{name} is {'unknown' if value is None else _shown(value)}" for name, value in known.items())
    return f" ({shown})" if shown else ""


def _shown(value: float | bool) -> str:
    return ("yes" if value else "no") if isinstance(value, bool) else f"{value:.3g}"
