"""Does every way end? For each situation the longest automatic way from it to the end, or what keeps it from ending."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from mission.executive.events import EVENTS
from mission.language.cycles import components, cyclic, shortest_cycle
from mission.language.document import enclosing
from mission.language.exploration import LANDS, Edge, Exploration, Situation
from mission.language.happening import behaviour_of

FOR_EVER = float("inf")


@dataclass(frozen=True)
class Way:
    """The longest way from an event to the end: transitions and seconds at most, and an example of it."""

    steps: int
    seconds: float
    trace: tuple[Edge, ...]


@dataclass(frozen=True)
class Failure:
    """Why a property does not hold, with the shortest trace that shows it. kind: unanswered, deadlock, livelock,
    airborne, vision or invariant. leaves: those that the message is about."""

    kind: str
    message: str
    trace: tuple[Edge, ...] = ()
    leaves: tuple[str, ...] = ()


class Endings:
    """Automatic steps, and for each situation whether every way from it ends, and the longest.

    vision: without it no behaviour that needs images ends with anything but failure: what is left must end as well.
    """

    def __init__(self, exploration: Exploration, vision: bool = True) -> None:
        self.exploration = exploration
        self.vision = vision
        self.assumptions: set[str] = set()
        self.order = {situation: number for number, situation in enumerate(exploration.situations)}
        self.edges: dict[Situation, list[Edge]] = {s: self._automatic(s) for s in exploration.situations}
        self.ways: dict[Situation, Way] = {}
        self.troubles: dict[Situation, Failure] = {}
        self._measure()

    def _automatic(self, situation: Situation) -> list[Edge]:
        state = self.exploration.state(situation)
        behaviour = behaviour_of(state)
        found = []
        for edge in self.exploration.edges.get(situation, ()):
            if not edge.automatic:
                continue
            if not self.vision and behaviour is not None and behaviour.needs_vision and edge.event not in EVENTS:
                continue
            if edge.target == situation and state.do in LANDS:
                self.assumptions.add(f"the vehicle lands, however often {state.path!r} has to ask")
                continue
            found.append(edge)
        return found

    def _measure(self) -> None:
        """Components from the ends backward; one with a cycle is bounded by its retries or by a deadline around it."""
        after = {situation: [edge.target for edge in edges] for situation, edges in self.edges.items()}
        component_of: dict[Situation, int] = {}
        for number, component in enumerate(components(self.exploration.situations, after)):
            for situation in component:
                component_of[situation] = number
            if cyclic(component, after):
                self._cycle(component, component_of, number)
            else:
                self._single(component[0])

    def _single(self, situation: Situation) -> None:
        state = self.exploration.state(situation)
        if state.final is not None:
            if situation.airborne and state.final != "released":
                message = f"the mission ends in {situation.leaf!r} while the vehicle flies"
                self.troubles[situation] = Failure("airborne", message, leaves=(situation.leaf,))
            self.ways[situation] = Way(0, 0.0, ())
            return
        self._stuck(situation)
        best: Way | None = None
        rank = (0, 0.0, False)
        for edge in self.edges[situation]:
            way = self.ways[edge.target]
            if edge.target in self.troubles:
                self.troubles.setdefault(situation, self.troubles[edge.target])
            # Of equally long ways the example is the one on which the work goes on.
            own = (way.steps + 1, way.seconds, edge.event not in EVENTS)
            if own > rank:
                rank, best = own, Way(way.steps + 1, way.seconds, (edge, *way.trace))
        best = best or Way(0, 0.0, ())
        self.ways[situation] = Way(best.steps, best.seconds + self._deadline_s(situation), best.trace)

    def _cycle(self, component: list[Situation], component_of: dict[Situation, int], number: int) -> None:
        """Every way through the component: once more than its retries allow, each time the longest way without them."""
        inside = set(component)
        retries = 0
        counted: set[str] = set()
        bounded: dict[Situation, list[Situation]] = {}
        exits: list[Edge] = []
        for situation in component:
            self._stuck(situation)
            for edge in self.edges[situation]:
                if edge.target not in inside:
                    exits.append(edge)
                elif edge.transition.retries is None:
                    bounded.setdefault(situation, []).append(edge.target)
                elif edge.transition.key not in counted:
                    counted.add(edge.transition.key)
                    retries += edge.transition.retries
        parts = components(component, bounded)
        for part in parts:
            if cyclic(part, bounded) and not self.deadline_around(part):
                path = shortest_cycle(min(part, key=self.order.__getitem__), part, bounded)
                message = f"nothing ends the cycle {self.told(path)}"
                failure = Failure("livelock", message, leaves=(path[0].leaf,))
                for situation in component:
                    self.troubles.setdefault(situation, failure)
        steps_each, seconds_each = self._longest_without_retries(parts, bounded)
        rounds = retries + 1
        last = max(exits, key=lambda edge: (self.ways[edge.target].steps, self.ways[edge.target].seconds), default=None)
        onward = self.ways[last.target] if last is not None else Way(0, 0.0, ())
        trace = (last, *onward.trace) if last is not None else ()
        way = Way(onward.steps + rounds * steps_each, onward.seconds + rounds * seconds_each, trace)
        for edge in exits:
            if edge.target in self.troubles:
                for situation in component:
                    self.troubles.setdefault(situation, self.troubles[edge.target])
        for situation in component:
            self.ways[situation] = way

    def _longest_without_retries(
        self, parts: list[list[Situation]], bounded: dict[Situation, list[Situation]]
    ) -> tuple[int, float]:
        """Most situations and most seconds on a way that takes no retry. parts: each after those it leads to."""
        best: dict[Situation, tuple[int, float]] = {}
        for part in parts:
            onward = [best[target] for situation in part for target in bounded.get(situation, ()) if target in best]
            steps = len(part) + max((steps for steps, _ in onward), default=0)
            seconds = sum(self._deadline_s(situation) for situation in part)
            seconds += max((seconds for _, seconds in onward), default=0.0)
            best.update(dict.fromkeys(part, (steps, seconds)))
        return max(steps for steps, _ in best.values()), max(seconds for _, seconds in best.values())

    def told(self, path: Sequence[Situation]) -> str:
        """A way without retries as text: `a → b (event) → a (event)`."""
        said = [path[0].leaf]
        for source, target in pairwise(path):
            edges = (edge for edge in self.edges[source] if edge.target == target)
            edge = next(edge for edge in edges if edge.transition.retries is None)
            said.append(f"{target.leaf} ({edge.event})")
        return " → ".join(said)

    def _stuck(self, situation: Situation) -> None:
        """A leaf that may last for ever, or whose end leads nowhere."""
        timed = [edge for edge in self.edges[situation] if edge.event == "timed_out" and not edge.transition.guarded]
        state = self.exploration.state(situation)
        assumed = state.do in LANDS and self._deadline_s(situation) < FOR_EVER
        if not timed and not assumed:
            known = self._deadline_s(situation) < FOR_EVER
            why = "its deadline leads nowhere for sure" if known else "it has no deadline"
            message = f"the mission can stay in {situation.leaf!r}: {why}"
            self.troubles[situation] = Failure("deadlock", message, leaves=(situation.leaf,))

    def _deadline_s(self, situation: Situation) -> float:
        states = self.exploration.mission.states
        own = [states[path].timeout_s for path in enclosing(situation.leaf)]
        return min((timeout for timeout in own if timeout is not None), default=FOR_EVER)

    def deadline_around(self, part: list[Situation]) -> bool:
        states = self.exploration.mission.states
        around = set(enclosing(part[0].leaf)) - {part[0].leaf}
        for situation in part:
            around &= set(enclosing(situation.leaf))
        inside = set(part)
        for situation in part:
            for edge in self.edges[situation]:
                if edge.target in inside and edge.transition.retries is None:
                    around &= set(enclosing(edge.transition.target)) - {edge.transition.target}
        return any(states[path].timeout_s is not None for path in around)
