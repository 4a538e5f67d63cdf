"""Runs every check."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from mission.language.checks import answers, bounds, distances, reachability, safety
from mission.language.diagnostics import Diagnostic
from mission.language.document import Mission
from mission.language.exploration import Exploration

CHECKS: tuple[Callable[[Exploration], Iterator[Diagnostic]], ...] = (
    reachability.unreachable,
    reachability.endless,
    reachability.idle,
    answers.unanswered_outcomes,
    answers.never_raised,
    answers.shadowed,
    bounds.without_deadline,
    bounds.unbounded_cycles,
    safety.unanswered_events,
    safety.blind_retreat,
    safety.ends_in_the_air,
    safety.wrong_side_of_take_off,
    distances.contradictions,
)


def check(mission: Mission) -> list[Diagnostic]:
    """Findings of all checks about a mission whose names and types are right."""
    exploration = Exploration(mission)
    return [finding for one in CHECKS for finding in one(exploration)]
