"""A YAML document as a tree in which every key and value knows where it was written. Immutable; aliases share nodes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from mission.language.location import Location

Plain = bool | int | float | str | None
Step = str | int


@dataclass(frozen=True)
class Scalar:
    """A single value. used_at: where a reference put it, if it came from a parameter. offset: columns between
    `location` and the first character of its text (1 within quotes)."""

    value: Plain
    location: Location
    offset: int = 0
    used_at: Location | None = None

    @property
    def size(self) -> int:
        return 1


@dataclass(frozen=True)
class Items:
    """A list."""

    items: tuple[Node, ...]
    location: Location
    size: int = 1


@dataclass(frozen=True)
class Entry:
    """A key with its place, and what belongs to it. first: where the key stands in the file that others only add to."""

    key: Location
    node: Node
    first: Location | None = None

    @property
    def origin(self) -> Location:
        """Where what belongs to the key was begun."""
        return self.first or self.key


@dataclass(frozen=True)
class Table:
    """A mapping, in the order of the file. folder: where paths in it start, for the outermost table of a file."""

    entries: Mapping[str, Entry]
    location: Location
    size: int = field(default=1, compare=False)

    def get(self, key: str) -> Node | None:
        """What belongs to a key, None without it."""
        entry = self.entries.get(key)
        return entry.node if entry else None

    def text(self, key: str) -> str | None:
        """The value of a key where it is a piece of text."""
        node = self.get(key)
        return node.value if isinstance(node, Scalar) and isinstance(node.value, str) else None

    def table(self, key: str) -> Table | None:
        """The value of a key where it is a mapping."""
        node = self.get(key)
        return node if isinstance(node, Table) else None

    def key_location(self, key: str) -> Location:
        """Where a key stands, or the mapping itself without it."""
        entry = self.entries.get(key)
        return entry.key if entry else self.location

    def replacing(self, key: str, node: Node, location: Location | None = None) -> Table:
        """The same with one value exchanged or added."""
        place = location or self.key_location(key)
        first = self.entries[key].first if key in self.entries else None
        return Table({**self.entries, key: Entry(place, node, first)}, self.location, self.size + node.size)

    def without(self, *keys: str) -> Table:
        """The same without some keys."""
        return Table({k: entry for k, entry in self.entries.items() if k not in keys}, self.location, self.size)


Node = Scalar | Items | Table


def plain(node: Node) -> Any:
    """The tree as dictionaries, lists and values."""
    if isinstance(node, Scalar):
        return node.value
    if isinstance(node, Items):
        return [plain(item) for item in node.items]
    return {key: plain(entry.node) for key, entry in node.entries.items()}


def descend(node: Node, path: Sequence[Step]) -> tuple[Node, Location]:
    """The node at a path, or the last one on the way that exists, with the place that a message about it points to:
    the key for what a mapping holds."""
    location = node.location
    for step in path:
        if isinstance(node, Table) and isinstance(step, str) and step in node.entries:
            entry = node.entries[step]
            node, location = entry.node, entry.key
        elif isinstance(node, Items) and isinstance(step, int) and 0 <= step < len(node.items):
            node = node.items[step]
            location = node.location
        else:
            break
    return node, location


def scalars(node: Node) -> Iterator[Scalar]:
    """Every single value below."""
    if isinstance(node, Scalar):
        yield node
    elif isinstance(node, Items):
        for item in node.items:
            yield from scalars(item)
    else:
        for entry in node.entries.values():
            yield from scalars(entry.node)


def kind(node: Node) -> str:
    """What a person would call the node: a number, text, a list …"""
    if isinstance(node, Items):
        return "a list"
    if isinstance(node, Table):
        return "a mapping"
    value = node.value
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return f"{str(value).lower()}"
    return f"the number {value:g}" if isinstance(value, int | float) else f"the text {value!r}"


def merge(below: Table, above: Table) -> Table:
    """`above` laid over `below`, mapping by mapping. Nothing (`~`) in `above` removes what `below` has.

    What `above` adds comes after the key that stands before it there (or first), so that states keep their order.
    """
    entries = dict(below.entries)
    before: str | None = None
    for key, entry in above.entries.items():
        present = entries.get(key)
        if present is None:
            entries = _inserted(entries, before, key, entry)
        elif isinstance(entry.node, Scalar) and entry.node.value is None:
            del entries[key]
            continue
        elif isinstance(present.node, Table) and isinstance(entry.node, Table):
            first = entry.key if _takes_over(present.node, entry.node) else present.origin
            entries[key] = Entry(entry.key, merge(present.node, entry.node), first)
        else:
            entries[key] = entry
        before = key
    return Table(entries, above.location, 1 + sum(entry.node.size for entry in entries.values()))


def _takes_over(below: Table, above: Table) -> bool:
    """Whether `above` takes something away from `below`, or has it do something else: what is then missing is missing
    because of it."""
    if "do" in above.entries:
        return True
    for key, entry in above.entries.items():
        present = below.get(key)
        if isinstance(entry.node, Scalar) and entry.node.value is None and present is not None:
            return True
        if isinstance(entry.node, Table) and isinstance(present, Table) and _takes_over(present, entry.node):
            return True
    return False


def _inserted(entries: dict[str, Entry], before: str | None, key: str, entry: Entry) -> dict[str, Entry]:
    if before is None:
        return {key: entry, **entries}
    ordered: dict[str, Entry] = {}
    for name, present in entries.items():
        ordered[name] = present
        if name == before:
            ordered[key] = entry
    return ordered
