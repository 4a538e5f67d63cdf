"""The format's version: the present one is read, an older one is brought up to date, a newer one is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mission.language.diagnostics import Diagnostic
from mission.language.tree import Entry, Items, Node, Scalar, Table, kind

VERSION = 1

_RENAMED_IN_1 = {"timeout": "timeout_s", "after": "after_s", "target": "to", "backoff": "backoff_s"}


def migrated(document: Table, problems: list[Diagnostic]) -> Table | None:
    """The document in the present format, None where its version is unknown."""
    node = document.get("version")
    if node is None:
        return document
    value = node.value if isinstance(node, Scalar) else None
    if isinstance(value, bool) or not isinstance(value, int):
        problems.append(Diagnostic(node.location, "M203", f"version is a whole number, not {kind(node)}"))
        return document
    if value > VERSION:
        message = f"the format version {value} is newer than this program, which reads up to {VERSION}"
        problems.append(Diagnostic(node.location, "M206", message, "update the program"))
        return None
    if value < min(_STEPS, default=VERSION):
        problems.append(Diagnostic(node.location, "M206", f"there is no format version {value}", f"write {VERSION}"))
        return None
    for version in range(value, VERSION):
        document = _STEPS[version](document)
    return document.replacing("version", Scalar(VERSION, node.location))


def _from_0(document: Table) -> Table:
    """Version 0 wrote times without their unit, and `history: true` for deep."""
    states = document.get("states")
    return document if states is None else document.replacing("states", _renamed(states))


def _renamed(node: Node) -> Node:
    if isinstance(node, Items):
        return Items(tuple(_renamed(item) for item in node.items), node.location, node.size)
    if isinstance(node, Scalar):
        return node
    entries: dict[str, Entry] = {}
    for key, entry in node.entries.items():
        inner = entry.node
        if key == "history" and isinstance(inner, Scalar) and isinstance(inner.value, bool):
            if inner.value:
                entries[key] = Entry(entry.key, Scalar("deep", inner.location))
        elif key == "with":
            entries[key] = entry
        else:
            entries[_RENAMED_IN_1.get(key, key)] = Entry(entry.key, _renamed(inner), entry.first)
    return Table(entries, node.location, node.size)


_STEPS: Mapping[int, Callable[[Table], Table]] = {0: _from_0}
