"""Do the distances that behaviours are told agree with the limits that hold while they run?"""

from __future__ import annotations

from collections.abc import Iterator

from mission.language.diagnostics import Diagnostic
from mission.language.exploration import Exploration


def contradictions(exploration: Exploration) -> Iterator[Diagnostic]:
    """M311: a standoff at or inside the clearance."""
    for leaf in exploration.leaves:
        state = exploration.mission.states[leaf]
        limits = state.limits or exploration.mission.limits
        standoff = getattr(state.parameters, "standoff_m", None)
        if isinstance(standoff, int | float) and standoff <= limits.clearance_m:
            message = f"standoff_m {standoff:g} in {leaf!r} is not above limits.clearance_m {limits.clearance_m:g}"
            yield Diagnostic(state.location, "M311", message, "too_close would be raised at once")
