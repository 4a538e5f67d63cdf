"""Everywhere a mission can get to: every leaf it can be in, on the ground or in the air, and every step between them.

Guards are taken as free and retries as used up or not: more is explored than can happen, never less. History is
followed as it is remembered; where that is too much to explore, it leads to any place that was reached. Whether the
vehicle flies follows from the behaviours that take it up and down.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

from mission.executive.events import EVENTS
from mission.language.document import Mission, State, Transition, enclosing
from mission.language.happening import happening, possible
from mission.language.remembering import Memory, Remembering, remembering

TAKES_OFF = "take_off"
LANDS = {"land": frozenset({"landed"})}
_MOST = 4000  # situations that are told apart by what is remembered


class Situation(NamedTuple):
    """A leaf, whether the vehicle may be in the air on entering it, and what is remembered: composite → leaf."""

    leaf: str
    airborne: bool
    memory: Memory = ()


class Edge(NamedTuple):
    """One step: an event that happens in a situation, what answers it, and where it leads."""

    source: Situation
    event: str
    transition: Transition
    target: Situation

    @property
    def automatic(self) -> bool:
        """Whether it happens without anybody wanting it: not by the operator."""
        event = EVENTS.get(self.event)
        return event is None or event.raised_by != "operator"


class Exploration:
    """What can be reached from a mission's beginning."""

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.edges: dict[Situation, tuple[Edge, ...]] = {}
        self.came_by: dict[Situation, Edge | None] = {}
        self._skips = [Transition("skip", path, "") for path, state in mission.states.items() if state.entry]
        self._reached: frozenset[str] = frozenset()
        self._remembering: Remembering | None = None
        self._answers: dict[str, tuple[tuple[str, Transition, bool], ...]] = {}
        self._explore()

    @property
    def situations(self) -> tuple[Situation, ...]:
        """In the order in which they were reached."""
        return tuple(self.came_by)

    @cached_property
    def leaves(self) -> Mapping[str, tuple[Situation, ...]]:
        """Leaf → its situations."""
        found: dict[str, list[Situation]] = {}
        for situation in self.came_by:
            found.setdefault(situation.leaf, []).append(situation)
        return {leaf: tuple(situations) for leaf, situations in found.items()}

    def all_edges(self) -> Iterator[Edge]:
        """Every step."""
        for edges in self.edges.values():
            yield from edges

    def state(self, situation: Situation) -> State:
        """The leaf's state."""
        return self.mission.states[situation.leaf]

    def flying(self, situation: Situation) -> bool:
        """Whether the vehicle may be in the air while it is in a situation."""
        return situation.airborne or self.state(situation).do == TAKES_OFF

    def trace(self, situation: Situation) -> tuple[Edge, ...]:
        """The shortest way there from the beginning."""
        steps: list[Edge] = []
        edge = self.came_by[situation]
        while edge is not None:
            steps.append(edge)
            edge = self.came_by[edge.source]
        return tuple(reversed(steps))

    def reaching(self, goals: set[Situation], automatic: bool = False) -> set[Situation]:
        """Situations from which one of the goals can be reached, the goals included."""
        before: dict[Situation, list[Situation]] = {}
        for edge in self.all_edges():
            if edge.automatic or not automatic:
                before.setdefault(edge.target, []).append(edge.source)
        found, waiting = set(goals), deque(goals)
        while waiting:
            for source in before.get(waiting.popleft(), ()):
                if source not in found:
                    found.add(source)
                    waiting.append(source)
        return found

    def finals(self, *outcomes: str) -> set[Situation]:
        """Reached final situations, of these outcomes or of any."""
        return {
            situation
            for situation in self.came_by
            if (final := self.state(situation).final) is not None and (not outcomes or final in outcomes)
        }

    @cached_property
    def retreat(self) -> frozenset[str]:
        """Leaves on the way out: entered on abort, or after it, and from which the mission can no longer be
        completed."""
        hopeful = {situation.leaf for situation in self.reaching(self.finals("completed"))}
        entered = {edge.target for edge in self.all_edges() if edge.transition.event == "abort"}
        waiting, found = deque(entered), set(entered)
        while waiting:
            for edge in self.edges.get(waiting.popleft(), ()):
                if edge.target not in found:
                    found.add(edge.target)
                    waiting.append(edge.target)
        return frozenset(situation.leaf for situation in found if situation.leaf not in hopeful)

    def _explore(self) -> None:
        """First with a history that leads anywhere, repeated until no round finds a new place; then as remembered."""
        while True:
            known = frozenset(situation.leaf for situation in self.came_by)
            self._reached = known
            self._everything()
            if all(edge.transition.history is None for edge in self.all_edges()):
                return
            if known == {situation.leaf for situation in self.came_by}:
                break
        free = self.came_by, self.edges
        entries = frozenset(self.mission.leaf(skip.target) for skip in self._skips)
        self._remembering = remembering(self.mission, self.all_edges(), entries)
        if not self._everything(_MOST):
            self.came_by, self.edges = free

    def _everything(self, most: int | None = None) -> bool:
        """Explore from the beginning; False where that leads to more situations than wanted."""
        self.came_by, self.edges = {}, {}
        self._spread(Situation(self.mission.leaf(self.mission.initial), False), None, most)
        # An operator may skip to an entry from anywhere in the mission; that is explored last, in the air.
        waiting = deque(self.came_by if self._skips else ())
        while waiting and (most is None or len(self.came_by) <= most):
            situation = waiting.popleft()
            known = len(self.came_by)
            for skip in self._skips if self.state(situation).final is None else ():
                leaf, memory = self._after(situation, skip)
                there = Situation(leaf, True, memory)
                self._spread(there, Edge(situation, skip.event, skip, there), most)
            waiting.extend(list(self.came_by)[known:])
        return most is None or len(self.came_by) <= most

    def _spread(self, first: Situation, by: Edge | None, most: int | None) -> None:
        if first in self.came_by:
            return
        self.came_by[first] = by
        waiting = deque([first])
        while waiting and (most is None or len(self.came_by) <= most):
            situation = waiting.popleft()
            self.edges[situation] = self._steps(situation)
            for edge in self.edges[situation]:
                if edge.target not in self.came_by:
                    self.came_by[edge.target] = edge
                    waiting.append(edge.target)

    def _steps(self, situation: Situation) -> tuple[Edge, ...]:
        flying, found = self.flying(situation), []
        ends: dict[tuple[int, bool], tuple[Situation, ...]] = {}  # many events are answered by one transition
        for name, transition, lands in self._answered(situation.leaf):
            asked = id(transition), flying and not lands
            if asked not in ends:
                ends[asked] = tuple(Situation(leaf, asked[1], mem) for leaf, mem in self._ends(situation, transition))
            found += [Edge(situation, name, transition, target) for target in ends[asked]]
        return tuple(found)

    def _answered(self, leaf: str) -> tuple[tuple[str, Transition, bool], ...]:
        """What can happen in a leaf, what may answer it, and whether the vehicle has landed by it."""
        known, state = self._answers.get(leaf), self.mission.states[leaf]
        if known is None:
            landed = LANDS.get(state.do or "", frozenset())
            known = self._answers[leaf] = tuple(
                (name, transition, name in landed)
                for name, origin in (happening(self.mission, leaf) if state.final is None else ())
                for transition in possible(self.mission, origin, name)
            )
        return known

    def _after(self, situation: Situation, transition: Transition) -> tuple[str, Memory]:
        if self._remembering is None:
            return self.mission.leaf(transition.target), ()
        return self._remembering.after(situation.leaf, situation.memory, transition)

    def _ends(self, situation: Situation, transition: Transition) -> Iterator[tuple[str, Memory]]:
        first, memory = self._after(situation, transition)
        yield first, memory
        if transition.history is None or self._remembering is not None:
            return
        mission, target = self.mission, transition.target
        leaves = {leaf for leaf in self._reached if target in enclosing(leaf)}
        if transition.history == "shallow":
            leaves = {mission.leaf(f"{target}.{leaf[len(target) + 1 :].split('.')[0]}") for leaf in leaves}
        yield from ((leaf, ()) for leaf in sorted(leaves - {first}))
