"""Makes mistakes on the lines of mission files, systematically: one for every key and value, several kinds of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mission.executive.events import EVENTS, outcomes
from mission.language.location import Location
from mission.language.tree import Entry, Items, Node, Scalar, Table
from mission.language.yaml_text import parse


@dataclass(frozen=True)
class Mistake:
    """A file with one mistake. lines: where it may rightly be reported; the mutated line first."""

    kind: str
    file: Path
    text: str
    lines: tuple[int, ...]
    what: str


def mistakes(path: Path) -> Iterator[Mistake]:
    """Every mistake that this module knows how to make in a file."""
    text = path.read_text()
    table = parse(text, str(path), [])
    known = _names(table) | set(EVENTS) | set(outcomes())
    for keys, entry in _entries(table, ()):
        yield from _in_key(path, text, keys, entry, known)
        if isinstance(entry.node, Scalar):
            yield from _in_value(path, text, keys, entry.node, known)
    yield from _in_layout(path, text)


def _in_key(path: Path, text: str, keys: tuple[str, ...], entry: Entry, known: set[str]) -> Iterator[Mistake]:
    name = keys[-1]
    for kind, typo in _typos(name):
        if typo not in known:
            yield _mutated(f"{kind} in a key", path, text, entry.key, name, typo)
    # A flow mapping takes a second entry on the same line, a block mapping another line of its own.
    if isinstance(entry.node, Scalar) and entry.node.value is not None:
        line = text.splitlines()[entry.key.line - 1]
        value = _written(text, entry.node)
        if line[: entry.key.column - 1].strip():
            yield _mutated("duplicate key", path, text, entry.key, name, f"{name}: {value}, {name}")
        else:
            indent = line[: entry.key.column - 1]
            copy = text.splitlines()
            copy.insert(entry.key.line, f"{indent}{name}: {value}")
            yield Mistake("duplicate key", path, "\n".join(copy) + "\n", (entry.key.line + 1,), name)


def _in_value(path: Path, text: str, keys: tuple[str, ...], node: Scalar, known: set[str]) -> Iterator[Mistake]:
    written, place = _written(text, node), node.location
    label = ".".join(keys)
    if isinstance(node.value, bool):
        wrong = {"wrong type": ["maybe", "7", "[true]"]}
    elif isinstance(node.value, int | float):
        wrong = {"out of range": ["1.0e+12", "-1.0e+12"], "wrong type": ["a lot", "[1]", "'60 s'", "true"]}
    else:
        free = keys[-1] in ("name", "text")
        number = [] if "${" in str(node.value) else ["7"]
        wrong = {"wrong type": [*number, "[]", "{a: b}"]}
        if not free and keys != ("mission",):
            wrong["missing target"] = ["nowhere_at_all"]
            wrong |= {kind: [typo] for kind, typo in _typos(str(node.value)) if typo not in known}
    wrong["broken anchor"] = ["*gone"]
    wrong["tag"] = ["!!python/name:os.system x"]
    for kind, values in wrong.items():
        for value in values:
            yield _mutated(f"{kind} in a value", path, text, place, written, value, f"{label}: {value}")


def _in_layout(path: Path, text: str) -> Iterator[Mistake]:
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        content = line.split("#")[0].rstrip()
        if not content.strip():
            continue
        indented = [*lines[: number - 1], "\t" + line, *lines[number:]]
        yield Mistake("tab", path, "\n".join(indented) + "\n", (number,), line.strip())
        if content.endswith("}"):
            broken = [*lines[: number - 1], content[:-1], *lines[number:]]
            yield Mistake("bracket not closed", path, "\n".join(broken) + "\n", (number,), line.strip())
        control = [*lines[: number - 1], content + "\x07", *lines[number:]]
        yield Mistake("control character", path, "\n".join(control) + "\n", (number,), line.strip())


def _typos(name: str) -> Iterator[tuple[str, str]]:
    if not name.isascii() or len(name) < 2:
        return
    yield "letter left out", name[: len(name) // 2] + name[len(name) // 2 + 1 :]
    yield "letter doubled", name[0] + name
    yield "letters swapped", name[:-2] + name[-1] + name[-2] if name[-1] != name[-2] else name + "e"


def _mutated(kind: str, path: Path, text: str, place: Location, old: str, new: str, what: str | None = None) -> Mistake:
    lines = text.split("\n")
    line, start = lines[place.line - 1], place.column - 1
    assert line[start : start + len(old)] == old, (line, start, old)
    lines[place.line - 1] = line[:start] + new + line[start + len(old) :]
    return Mistake(kind, path, "\n".join(lines), (place.line,), what or f"{old} → {new}")


def _written(text: str, node: Scalar) -> str:
    """A scalar as it stands in the text, quotes included."""
    line = text.split("\n")[node.location.line - 1][node.location.column - 1 :]
    if line[:1] in ("'", '"'):
        return line[: line.index(line[0], 1) + 1]
    end = len(line)
    for stop in (", ", "}", "]", " #"):
        if 0 <= line.find(stop) < end:
            end = line.find(stop)
    return line[:end].rstrip()


def _entries(node: Node, keys: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Entry]]:
    if isinstance(node, Table):
        for key, entry in node.entries.items():
            yield (*keys, key), entry
            yield from _entries(entry.node, (*keys, key))
    elif isinstance(node, Items):
        for item in node.items:
            yield from _entries(item, keys)


def _names(node: Table) -> set[str]:
    return {key for keys, _ in _entries(node, ()) for key in keys}
