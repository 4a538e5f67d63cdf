"""Can every state be reached, and does a way lead from every state to an end?"""

from __future__ import annotations

from collections.abc import Iterator

from mission.language.diagnostics import Diagnostic
from mission.language.document import enclosing
from mission.language.exploration import Exploration


def unreachable(exploration: Exploration) -> Iterator[Diagnostic]:
    """M301: states that nothing leads to; of several inside each other the outermost."""
    mission = exploration.mission
    reached = {path for leaf in exploration.leaves for path in enclosing(leaf)}
    for path, state in mission.states.items():
        if path not in reached and (state.parent is None or state.parent in reached):
            yield Diagnostic(state.location, "M301", f"nothing leads to the state {path!r}", "remove it, or go there")


def endless(exploration: Exploration) -> Iterator[Diagnostic]:
    """M302: leaves from which no final state can be reached."""
    ending = {situation.leaf for situation in exploration.reaching(exploration.finals())}
    for leaf in exploration.leaves:
        if leaf not in ending:
            state = exploration.mission.states[leaf]
            yield Diagnostic(state.location, "M302", f"no way leads from the state {leaf!r} to a final state")


def idle(exploration: Exploration) -> Iterator[Diagnostic]:
    """M312: leaves that do nothing and have no deadline: only somebody else's event ends them."""
    for leaf in exploration.leaves:
        state = exploration.mission.states[leaf]
        if state.do is None and state.final is None:
            bounded = any(exploration.mission.states[path].timeout_s is not None for path in enclosing(leaf))
            if not bounded:
                message = f"the state {leaf!r} does nothing and has no deadline"
                yield Diagnostic(state.location, "M312", message, "give it `do`, or timeout_s")
