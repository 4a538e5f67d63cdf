"""Does everything come to an end: deadlines in the air, and cycles with a bound?"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from mission.language.cycles import components, cyclic, shortest_cycle
from mission.language.diagnostics import Diagnostic
from mission.language.document import enclosing
from mission.language.exploration import Edge, Exploration, Situation


def without_deadline(exploration: Exploration) -> Iterator[Diagnostic]:
    """M306: leaves in the air that may last for ever."""
    mission = exploration.mission
    for leaf, situations in exploration.leaves.items():
        state = mission.states[leaf]
        if state.final is not None or not any(exploration.flying(situation) for situation in situations):
            continue
        if all(mission.states[path].timeout_s is None for path in enclosing(leaf)):
            message = f"the airborne state {leaf!r} has no deadline"
            yield Diagnostic(state.location, "M306", message, "add timeout_s, here or in a state around it")


def unbounded_cycles(exploration: Exploration) -> Iterator[Diagnostic]:
    """M305: cycles that can go on for ever by themselves: no retries on any of their transitions, no deadline
    around."""
    edges = [edge for edge in exploration.all_edges() if edge.automatic and edge.transition.retries is None]
    after: dict[Situation, list[Situation]] = {}
    step: dict[tuple[Situation, Situation], Edge] = {}
    for edge in edges:
        if edge.target not in after.setdefault(edge.source, []):
            after[edge.source].append(edge.target)
            step[edge.source, edge.target] = edge
    reported: set[str] = set()
    for component in components(exploration.situations, after):
        if not cyclic(component, after):
            continue
        order = {situation: number for number, situation in enumerate(exploration.situations)}
        path = shortest_cycle(min(component, key=order.__getitem__), component, after)
        steps = [step[pair] for pair in pairwise(path)]
        if _ended_from_outside(exploration, steps):
            continue
        last = steps[-1]
        if last.transition.key in reported:
            continue
        reported.add(last.transition.key)
        way = " → ".join([steps[0].source.leaf, *(f"{edge.target.leaf} ({edge.event})" for edge in steps)])
        hint = "give one of its transitions retries, or a state around it timeout_s"
        yield Diagnostic(last.transition.location, "M305", f"this cycle has no bound: {way}", hint)


def _ended_from_outside(exploration: Exploration, steps: list[Edge]) -> bool:
    """Whether a composite that no step of the cycle leaves has a deadline."""
    states = exploration.mission.states
    around = set(enclosing(steps[0].source.leaf)) - {steps[0].source.leaf}
    for edge in steps:
        target = edge.transition.target
        around &= set(enclosing(edge.target.leaf)) - {edge.target.leaf, target} & (set(enclosing(target)) - {target})
    return any(states[path].timeout_s is not None for path in around)
