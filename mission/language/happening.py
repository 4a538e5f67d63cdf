"""What can happen in a state, what may answer it there, and how what the state does can end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from mission.behaviours.behaviour import Behaviour, behaviours
from mission.executive.events import EVENTS, Event, Severity
from mission.language.document import Mission, State, Transition, enclosing

_BY_REQUEST = ("step", "skip")
_ABOUT_BEHAVIOURS = ("behaviour_failed", "behaviour_stuck")


def happening(mission: Mission, leaf: str) -> Iterator[tuple[str, str]]:
    """Everything that can happen in a leaf: (event, the state that it is about)."""
    state = mission.states[leaf]
    behaviour, outcomes = behaviour_of(state), outcomes_of(state)
    for event in EVENTS.values():
        if event.name in ("timed_out", *_BY_REQUEST) or (event.name in _ABOUT_BEHAVIOURS and behaviour is None):
            continue
        if event.name == "failed" and "failed" not in outcomes:
            continue
        yield event.name, leaf
    for outer in enclosing(leaf):
        if mission.states[outer].timeout_s is not None:
            yield "timed_out", outer
    for outcome in outcomes:
        if outcome not in EVENTS:
            yield outcome, leaf


def possible(mission: Mission, origin: str, event: str) -> Iterator[Transition]:
    """Transitions that may answer an event: up to the first that always does, as guards and retries can pass it on."""
    for transition in mission.handlers(origin, event):
        yield transition
        if not transition.guarded and transition.retries is None:
            return


def behaviour_of(state: State) -> Behaviour | None:
    """What a state does."""
    return behaviours().get(state.do) if state.do else None


def outcomes_of(state: State) -> Mapping[str, str]:
    """How what a state does can end, with the parameters that it is given: name → what it means."""
    behaviour = behaviour_of(state)
    return behaviour.outcomes_with(state.parameters) if behaviour is not None else {}


def safety_events() -> tuple[Event, ...]:
    """Events of the table that are about safety: those that must not go unheard in the air."""
    return tuple(event for event in EVENTS.values() if event.severity in (Severity.SAFETY, Severity.CRITICAL))
