"""States and answers that are not what they should be: no mappings, found in each file by itself as composed they may
be hidden, and names that are nearly another's."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from mission.language.diagnostics import Diagnostic, suggestion
from mission.language.tree import Items, Node, Scalar, Table, kind


def misshapen(node: Node) -> Iterator[Diagnostic]:
    """Findings of a whole file. Nothing (`~`) may stand anywhere: it removes what lies below."""
    if isinstance(node, Items):
        for item in node.items:
            yield from misshapen(item)
    if not isinstance(node, Table):
        return
    for key, entry in node.entries.items():
        if key == "on" and _no_mapping(entry.node):
            yield no_answers(entry.node)
        elif key == "states" and isinstance(entry.node, Table):
            for name, state in entry.node.entries.items():
                if _no_mapping(state.node):
                    yield no_state(name, state.node)
        yield from misshapen(entry.node)


def no_answers(node: Node) -> Diagnostic:
    """What stands under `on:` is no mapping."""
    return Diagnostic(node.location, "M203", f"on must map events to states, not {kind(node)}", "as in {done: land}")


def no_state(name: str, node: Node) -> Diagnostic:
    """What stands under a state's name is no mapping."""
    return Diagnostic(node.location, "M203", f"the state {name!r} must be a mapping, not {kind(node)}")


def _no_mapping(node: Node) -> bool:
    return not isinstance(node, Table) and not (isinstance(node, Scalar) and node.value is None)


def mistaken_for(path: str, states: Iterable[str]) -> str:
    """The state beside it whose name is so near that one of the two may be a typo."""
    scope, _, name = path.rpartition(".")
    beside = [other.rpartition(".") for other in states if other != path]
    return suggestion(name, [last for outer, _, last in beside if outer == scope])
