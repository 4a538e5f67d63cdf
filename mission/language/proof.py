"""Proof by exhaustion: every situation × every event, guards free. Does each safety event lead to a safe end, and when?

Assumed: a behaviour ends with one of its outcomes, fails, or meets its deadline; the executive answers every event; and
an autopilot that is asked to land again and again does so, which every report repeats.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from mission.executive.events import Event
from mission.language.document import Mission
from mission.language.endings import Endings, Failure, Way
from mission.language.exploration import Edge, Exploration, Situation
from mission.language.happening import behaviour_of, safety_events
from mission.language.invariant_proof import InvariantProof, invariant_proof


@dataclass(frozen=True)
class EventProof:
    """One event: in how many airborne situations it was tried, its longest way to a safe end, and what is wrong."""

    event: Event
    situations: int
    longest: Way | None
    failures: tuple[Failure, ...] = ()


@dataclass(frozen=True)
class Proof:
    """Everything that was explored and found. failures: ways that never end although nothing unsafe happens."""

    mission: Mission
    situations: int
    steps: int
    events: tuple[EventProof, ...]
    invariants: tuple[InvariantProof, ...]
    assumptions: tuple[str, ...] = ()
    failures: tuple[Failure, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every property holds."""
        events = not any(one.failures for one in self.events)
        return events and not self.failures and all(one.failure is None for one in self.invariants)


def prove(mission: Mission) -> Proof:
    """Prove a mission whose names and types are right."""
    exploration = Exploration(mission)
    graph = Endings(exploration)
    blind = Endings(exploration, vision=False)
    airborne = [s for s in exploration.situations if exploration.flying(s) and exploration.state(s).final is None]
    return Proof(
        mission,
        len(exploration.situations),
        sum(1 for _ in exploration.all_edges()),
        tuple(_event(event, airborne, exploration, graph, blind) for event in safety_events()),
        tuple(invariant_proof(invariant, exploration, graph) for invariant in mission.invariants),
        tuple(sorted(graph.assumptions)),
        _endless(exploration, graph),
    )


def _endless(exploration: Exploration, graph: Endings) -> tuple[Failure, ...]:
    """What keeps the mission's own work from ending: a deadlock, a livelock, an end in the air; the nearest of each."""
    found: dict[str, Failure] = {}
    for situation in exploration.situations:
        trouble = graph.troubles.get(situation)
        if trouble is not None and trouble.kind not in found:
            trace = (*exploration.trace(situation), *_to_trouble(graph, situation, trouble))
            found[trouble.kind] = Failure(trouble.kind, trouble.message, trace)
    return tuple(found.values())


def _event(
    event: Event, airborne: Iterable[Situation], exploration: Exploration, graph: Endings, blind: Endings
) -> EventProof:
    """Let the event happen in every airborne situation."""
    failures: dict[str, Failure] = {}
    longest: Way | None = None
    tried = 0
    for situation in airborne:
        edges = [edge for edge in exploration.edges[situation] if edge.event == event.name]
        if not edges:
            if _must_answer(event, situation, exploration):
                message = f"{event.name} has no answer in {situation.leaf!r}"
                failures.setdefault("unanswered", Failure("unanswered", message, exploration.trace(situation)))
            continue
        tried += 1
        for edge in edges:
            for one, blindly in ((graph, ""), (blind, ", if nothing is seen any more")):
                trouble = one.troubles.get(edge.target)
                if trouble is not None and trouble.kind not in failures:
                    trace = (*exploration.trace(situation), edge, *_to_trouble(one, edge.target, trouble))
                    kind = "vision" if blindly and trouble.kind == "deadlock" else trouble.kind
                    failures.setdefault(kind, Failure(kind, trouble.message + blindly, trace))
            behaviour = behaviour_of(exploration.state(edge.target))
            if behaviour is not None and behaviour.needs_vision and edge.target.leaf in exploration.retreat:
                message = f"{event.name} leads to {edge.target.leaf!r}, which needs images"
                failures.setdefault("vision", Failure("vision", message, (*exploration.trace(situation), edge)))
            if edge.target in graph.troubles:
                continue
            way = graph.ways[edge.target]
            if longest is None or (way.steps + 1, way.seconds) > (longest.steps, longest.seconds):
                longest = Way(way.steps + 1, way.seconds, (edge, *way.trace))
    return EventProof(event, tried, longest, tuple(failures.values()))


def _must_answer(event: Event, situation: Situation, exploration: Exploration) -> bool:
    from mission.language.checks.safety import needed

    return event.name in {one.name for one in needed(exploration, situation.leaf)}


def _to_trouble(graph: Endings, start: Situation, trouble: Failure) -> tuple[Edge, ...]:
    """The shortest automatic way to a situation that has this trouble of its own."""
    came: dict[Situation, Edge | None] = {start: None}
    waiting = [start]
    for situation in waiting:
        onward = [edge for edge in graph.edges[situation] if graph.troubles.get(edge.target) == trouble]
        if not onward or situation.leaf in trouble.leaves:
            return _back(came, situation)
        for edge in onward:
            if edge.target not in came:
                came[edge.target] = edge
                waiting.append(edge.target)
    return ()


def _back(came: dict[Situation, Edge | None], end: Situation) -> tuple[Edge, ...]:
    path: list[Edge] = []
    edge = came[end]
    while edge is not None:
        path.append(edge)
        edge = came[edge.source]
    return tuple(reversed(path))
