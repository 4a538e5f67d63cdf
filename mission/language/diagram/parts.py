"""What a diagram shows: which transitions belong to the mission's own way, to safety, to the operator."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from mission.executive.events import EVENTS, Severity
from mission.language.conditions import Condition
from mission.language.document import Mission, Transition
from mission.language.exploration import Edge, Exploration, Situation

Kind = Literal["way", "outcome", "safety", "operator"]

_LONGEST = 28  # characters of a condition, so that a label stays beside the behaviour


@dataclass(frozen=True)
class Visit:
    """How often a run was in a state and for how long in all."""

    times: int
    seconds: float


@dataclass(frozen=True)
class Painting:
    """Where a run went. visits: state → visits, of leaves and of those around them. taken: transition key → times."""

    run: str
    visits: Mapping[str, Visit]
    taken: Mapping[str, int]


def kinds(mission: Mission) -> dict[str, Kind]:
    """Transition key → what it is shown as. `way` is the shortest path from the beginning to `completed`."""
    way = {edge.transition.key for edge in initial_path(Exploration(mission))}
    return {
        transition.key: "way" if transition.key in way else kind_of(transition) for transition in mission.transitions()
    }


def kind_of(transition: Transition) -> Kind:
    """Safety, operator, or an ordinary outcome."""
    event = EVENTS.get(transition.event)
    if event is None or event.severity is Severity.INFO:
        return "outcome"
    if event.severity is Severity.OPERATOR:
        return "operator"
    return "safety"


def initial_path(exploration: Exploration) -> tuple[Edge, ...]:
    """The shortest way of outcomes alone from the beginning to completion (or else to any end); where there is one,
    without conditions: what is skipped under a condition belongs to it."""
    first = exploration.situations[0]
    completed, ended = exploration.finals("completed"), exploration.finals()
    for goals, guarded in ((completed, False), (completed, True), (ended, True)):
        came: dict[Situation, Edge | None] = {first: None}
        waiting = deque([first])
        while waiting:
            situation = waiting.popleft()
            if situation in goals:
                path: list[Edge] = []
                edge = came[situation]
                while edge is not None:
                    path.append(edge)
                    edge = came[edge.source]
                return tuple(reversed(path))
            for edge in exploration.edges.get(situation, ()):
                outcome = edge.event not in EVENTS and edge.event == edge.transition.event
                if outcome and edge.target not in came and (guarded or not edge.transition.guarded):
                    came[edge.target] = edge
                    waiting.append(edge.target)
    return ()


def _short(condition: Condition) -> str:
    text = str(condition)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 2].rstrip()} …"


def label(transition: Transition) -> str:
    """The event with what it depends on."""
    parts = [transition.event]
    if transition.when is not None:
        parts.append(f"[{_short(transition.when)}]")
    if transition.unless is not None:
        parts.append(f"[not: {_short(transition.unless)}]")
    if transition.after_s is not None:
        parts.append(f"after {transition.after_s:g} s")
    if transition.retries is not None:
        parts.append(f"×{transition.retries}")
    if transition.history is not None:
        parts.append("(H*)" if transition.history == "deep" else "(H)")
    if transition.confirm:
        parts.append("(asks)")
    return " ".join(parts)


def details(mission: Mission, path: str) -> str:
    """What a state does and for how long at most."""
    state = mission.states[path]
    does = state.do or ""
    if state.do and any(other.do == state.do and other.path != path for other in mission.states.values()):
        told = state.parameters.model_dump(exclude_unset=True) if state.parameters is not None else {}
        words = [str(value) for value in told.values() if isinstance(value, str)]
        does = " ".join([does, *words])
    deadline = f"≤ {state.timeout_s:g} s" if state.timeout_s is not None else ""
    return " · ".join(part for part in (does, deadline) if part)
