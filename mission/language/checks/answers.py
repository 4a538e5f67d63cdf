"""Does every outcome lead somewhere, and can every transition be taken?"""

from __future__ import annotations

from collections.abc import Iterator

from mission.executive.events import EVENTS
from mission.language.diagnostics import Diagnostic, choices, suggestion
from mission.language.document import Transition, enclosing
from mission.language.exploration import Exploration
from mission.language.happening import behaviour_of, outcomes_of


def unanswered_outcomes(exploration: Exploration) -> Iterator[Diagnostic]:
    """M303: outcomes of a behaviour for which no state around it has an entry."""
    mission = exploration.mission
    for leaf in exploration.leaves:
        state = mission.states[leaf]
        behaviour = behaviour_of(state)
        if behaviour is None:
            continue
        for outcome, text in outcomes_of(state).items():
            if not any(transition.event == outcome for transition in mission.handlers(leaf, outcome)):
                if outcome in EVENTS and any(True for _ in mission.handlers(leaf, outcome)):
                    continue
                message = f"{behaviour.name} in {leaf!r} can end with {outcome!r} ({text}), which leads nowhere"
                yield Diagnostic(state.location, "M303", message, f"add {outcome}: STATE under on")


def never_raised(exploration: Exploration) -> Iterator[Diagnostic]:
    """M216: entries for an outcome that no behaviour in or below the state has, or for a deadline that is not there."""
    mission = exploration.mission
    for transition in mission.transitions():
        leaves = _leaves_under(exploration, transition.source)
        if not leaves:
            continue
        if transition.event == "timed_out":
            bounded = any(mission.states[path].timeout_s is not None for leaf in leaves for path in enclosing(leaf))
            if not bounded:
                yield Diagnostic(transition.location, "M216", "timed_out is never raised here: no timeout_s is set")
        elif transition.event not in EVENTS:
            outcomes = {name for leaf in leaves for name in outcomes_of(mission.states[leaf])}
            if transition.event not in outcomes:
                message = f"nothing {_within(transition)} can end with {transition.event!r}"
                hint = suggestion(transition.event, outcomes) or choices(outcomes)
                yield Diagnostic(transition.location, "M216", message, hint)


def shadowed(exploration: Exploration) -> Iterator[Diagnostic]:
    """M304: entries that others always answer before them."""
    taken = {edge.transition.key for edge in exploration.all_edges()}
    noted = {finding.location for finding in never_raised(exploration)}
    for transition in exploration.mission.transitions():
        if transition.key in taken or transition.location in noted:
            continue
        if not _leaves_under(exploration, transition.source) or transition.event in ("step", "skip"):
            continue
        message = f"{transition.event!r} never gets here: entries further in or above always answer it first"
        if not _happens(exploration, transition):
            message = f"{transition.event!r} does not happen {_within(transition)}"
        yield Diagnostic(transition.location, "M304", message, "remove it")


def _happens(exploration: Exploration, transition: Transition) -> bool:
    from mission.executive.events import fallbacks
    from mission.language.happening import happening

    return any(
        transition.event in fallbacks(name)
        for leaf in _leaves_under(exploration, transition.source)
        for name, _ in happening(exploration.mission, leaf)
    )


def _leaves_under(exploration: Exploration, source: str) -> list[str]:
    """Reached leaves in a state; with "" all of them, except final ones."""
    return [
        leaf
        for leaf in exploration.leaves
        if (not source or source in enclosing(leaf)) and exploration.mission.states[leaf].final is None
    ]


def _within(transition: Transition) -> str:
    return f"in {transition.source!r}" if transition.source else "in this mission"
