"""Which histories can still matter where: what a machine remembers is told apart only as long as somebody may ask."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from mission.language import semantics
from mission.language.document import Mission, Transition, enclosing

if TYPE_CHECKING:
    from mission.language.exploration import Edge

Memory = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Remembering:
    """asked: composite → leaves in which it is not active and from which a transition with history to it may come
    before it is entered anew, so that the leaf it was left in still matters."""

    mission: Mission
    asked: Mapping[str, frozenset[str]]
    _known: dict[tuple[str, Memory, int], tuple[str, Memory]] = field(default_factory=dict, compare=False)

    def after(self, leaf: str, memory: Memory, transition: Transition) -> tuple[str, Memory]:
        """Where a transition leads, and what is remembered there: as the executive would."""
        asked = (leaf, memory, id(transition))  # many events are answered by one transition
        found = self._known.get(asked)
        if found is None:
            found = self._known[asked] = self._after(leaf, memory, transition)
        return found

    def _after(self, leaf: str, memory: Memory, transition: Transition) -> tuple[str, Memory]:
        step = semantics.take(self.mission, semantics.Configuration(leaf, dict(memory)), transition)
        kept = (
            (composite, step.after.history[composite])
            for composite, leaves in self.asked.items()
            if step.after.leaf in leaves and composite in step.after.history
        )
        return step.after.leaf, tuple(kept)


def remembering(mission: Mission, edges: Iterable[Edge], skipped_to: frozenset[str]) -> Remembering:
    """edges: every step that may be possible, history taken as free. skipped_to: leaves that an operator may skip to
    from anywhere."""
    steps = [(edge.source.leaf, edge.target.leaf, edge.transition) for edge in edges]
    wanted = dict.fromkeys(transition.target for _, _, transition in steps if transition.history is not None)
    asked: dict[str, frozenset[str]] = {}
    for composite in wanted:
        outside = {leaf for leaf in mission.leaves() if composite not in enclosing(leaf)}
        before: dict[str, set[str]] = {}
        found: set[str] = set()
        for source, target, transition in steps:
            before.setdefault(target, set()).add(source)
            if transition.history is not None and transition.target == composite and source in outside:
                found.add(source)
        waiting = list(found)
        while waiting:
            leaf = waiting.pop()
            sources = outside if leaf in skipped_to else before.get(leaf, set()) & outside
            waiting += sources - found
            found |= sources
        asked[composite] = frozenset(found)
    return Remembering(mission, asked)
