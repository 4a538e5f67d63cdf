"""The resolved mission document in a run's folder, as readers of the record need it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


def states_of(document: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Path and content of every state, outer ones before those inside, in the document's order."""
    yield from _below(document.get("states") or {}, "")


def _below(states: Any, above: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for name, state in states.items() if isinstance(states, dict) else ():
        if isinstance(state, dict):
            path = f"{above}.{name}" if above else str(name)
            yield path, state
            yield from _below(state.get("states") or {}, path)
