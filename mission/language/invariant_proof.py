"""Holds a mission to the statements that it makes about itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mission.language.cycles import components, cyclic, shortest_cycle
from mission.language.document import enclosing
from mission.language.endings import Endings, Failure
from mission.language.exploration import Exploration, Situation
from mission.language.happening import behaviour_of
from mission.language.invariants import Invariant


@dataclass(frozen=True)
class InvariantProof:
    """One invariant and the counterexample, None where it holds."""

    invariant: Invariant
    failure: Failure | None


def invariant_proof(invariant: Invariant, exploration: Exploration, graph: Endings) -> InvariantProof:
    """Look at every situation for a counterexample."""
    truth = {
        situation: invariant.statement.evaluate(flags(exploration, situation)) for situation in exploration.situations
    }
    if invariant.kind == "never":
        for situation, true in truth.items():
            if true:
                message = f"{invariant.statement} becomes true in {situation.leaf!r}"
                return InvariantProof(invariant, Failure("invariant", message, exploration.trace(situation)))
        return InvariantProof(invariant, None)
    failure = _avoidable(invariant, exploration, graph, lambda situation: truth[situation])
    return InvariantProof(invariant, failure)


def _avoidable(
    invariant: Invariant, exploration: Exploration, graph: Endings, reached: Callable[[Situation], bool]
) -> Failure | None:
    """A way on which the statement never becomes true: it ends, stays, or goes round without it."""
    away = [situation for situation in exploration.situations if not reached(situation)]
    outside = set(away)
    after = {
        situation: [e.target for e in graph.edges[situation] if e.target in outside and e.transition.retries is None]
        for situation in away
    }
    rounds = {
        min(component, key=graph.order.__getitem__): component
        for component in components(away, after)
        if cyclic(component, after) and not graph.deadline_around(component)
    }
    for situation in away:  # the nearest first
        trouble = graph.troubles.get(situation)
        if exploration.state(situation).final is not None:
            message = f"the mission can end in {situation.leaf!r} without {invariant.statement}"
        elif trouble is not None and trouble.kind == "deadlock" and situation.leaf in trouble.leaves:
            message = trouble.message
        elif situation in rounds:
            path = shortest_cycle(situation, rounds[situation], after)
            message = f"{graph.told(path)} can go on for ever without {invariant.statement}"
        else:
            continue
        return Failure("invariant", message, exploration.trace(situation))
    return None


def flags(exploration: Exploration, situation: Situation) -> dict[str, float | bool | None]:
    """What invariants may ask of a situation."""
    state = exploration.state(situation)
    behaviour = behaviour_of(state)
    flying = exploration.flying(situation)
    found: dict[str, float | bool | None] = {
        "airborne": flying,
        "armed": flying,
        "laser_on": behaviour is not None and behaviour.laser,
        "recording": bool(getattr(state.parameters, "record", False)),
        "needs_vision": behaviour is not None and behaviour.needs_vision,
        "ended": state.final is not None,
    }
    active = set(enclosing(situation.leaf))
    return found | {f"in({path})": path in active for path in exploration.mission.states}
