"""Parser events to a tree with places: iterative, with limits, tags refused, scalars by the core schema of YAML 1.2."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import yaml

from mission.language.diagnostics import Diagnostic, suggestion
from mission.language.location import Location
from mission.language.syntax import syntax_error
from mission.language.tree import Entry, Items, Node, Plain, Scalar, Table

MOST_NODES = 20_000
DEEPEST = 40

# A leading zero is octal to some readers of YAML and decimal to others: not a number here.
_INTEGER = re.compile(r"[-+]?(0|[1-9]\d*)")
_FLOAT = re.compile(r"[-+]?(\.\d+|(0|[1-9]\d*)(\.\d*)?)([eE][-+]?\d+)?")
_SPECIAL: dict[str, Plain] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".inf", ".Inf", "+.inf"), float("inf")),
    "-.inf": float("-inf"),
    ".nan": float("nan"),
}
# Of Unicode: line breaks that only some programs see, and marks that change the direction of what is shown.
CONTROL = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff\ufffe\uffff]"
)

# The C parser is ten times faster; a build of PyYAML without libyaml still works.
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class UnreadableError(Exception):
    """The text is no document at all."""

    def __init__(self, diagnostic: Diagnostic) -> None:
        super().__init__(str(diagnostic))
        self.diagnostic = diagnostic


def scalar_value(text: str) -> Plain:
    """The value of an unquoted scalar by the core schema of YAML 1.2."""
    if text in _SPECIAL:
        return _SPECIAL[text]
    if _INTEGER.fullmatch(text):
        return int(text) if len(text) < 25 else float(text)
    return float(text) if _FLOAT.fullmatch(text) else text


@dataclass
class _Open:
    """A list or mapping that is being read."""

    location: Location
    is_table: bool
    anchor: str | None
    items: list[Node] = field(default_factory=list)
    entries: dict[str, Entry] = field(default_factory=dict)
    key: tuple[str, Location] | None = None
    merges: list[Node] = field(default_factory=list)


class TreeBuilder:
    """Builds the tree from parser events: iterative, so that deep nesting meets a limit and not the end of the
    stack."""

    def __init__(self, file: str, problems: list[Diagnostic], lines: bool = True) -> None:
        self.file = file
        self.problems = problems
        self.lines = lines
        self.anchors: dict[str, Node | None] = {}
        self.stack: list[_Open] = []
        self.root: Node | None = None
        self.nodes = 0
        self.wide: tuple[Location, int] | None = None  # the last text over several lines, and its last

    def build(self, text: str) -> Node | None:
        documents = 0
        for event in self.events(text):
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise self.stop(self.place(event.start_mark), "M002", "a second document begins here: one per file")
            elif isinstance(event, yaml.AliasEvent):
                self.add(self.aliased(event), self.place(event.start_mark))
            elif isinstance(event, yaml.ScalarEvent):
                self.scalar(event)
            elif isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent):
                self.open(event)
            elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
                self.close()
        return self.root

    def events(self, text: str) -> Iterator[yaml.Event]:
        try:
            yield from yaml.parse(text, Loader=_Loader)
        except yaml.MarkedYAMLError as error:
            raise UnreadableError(syntax_error(error, text, self.file, self.wide, self.lines)) from None
        except yaml.YAMLError as error:
            raise self.stop(Location(self.file, 1, 1), "M002", str(error).splitlines()[0]) from None

    def place(self, mark: Any) -> Location:
        if not self.lines:
            return Location(self.file, 0, 0)
        return Location(self.file, mark.line + 1, mark.column + 1) if mark else Location(self.file, 1, 1)

    def stop(self, place: Location, code: str, message: str, hint: str = "") -> UnreadableError:
        return UnreadableError(Diagnostic(place, code, message, hint))

    def aliased(self, event: yaml.AliasEvent) -> Node:
        place = self.place(event.start_mark)
        name = str(event.anchor)
        if name not in self.anchors:
            hint = suggestion(name, self.anchors)
            self.problems.append(Diagnostic(place, "M008", f"there is no anchor &{name} before this alias", hint))
            return Scalar(None, place)
        node = self.anchors[name]
        if node is None:
            raise self.stop(place, "M006", f"the anchor &{name} contains itself")
        return node

    def scalar(self, event: yaml.ScalarEvent) -> None:
        place = self.place(event.start_mark)
        self.refuse_tag(event.tag, place)
        unquoted = event.style is None or event.style == ""
        quoted = event.style in ("'", '"')
        if quoted and event.end_mark is not None and self.place(event.end_mark).line > place.line:
            self.wide = (place, event.end_mark.line + 1)
        text = str(event.value)
        if CONTROL.search(text):
            self.problems.append(Diagnostic(place, "M007", "a control character is written in this text"))
            text = CONTROL.sub("?", text)
        waiting_key = bool(self.stack) and self.stack[-1].is_table and self.stack[-1].key is None
        value = text if waiting_key or not unquoted else scalar_value(text)
        node = Scalar(value, place, 0 if unquoted else 1)
        self.remember(event.anchor, node)
        self.add(node, place)

    def open(self, event: yaml.MappingStartEvent | yaml.SequenceStartEvent) -> None:
        place = self.place(event.start_mark)
        self.refuse_tag(event.tag, place)
        if len(self.stack) >= DEEPEST:
            raise self.stop(place, "M006", f"nesting is deeper than {DEEPEST}")
        if event.anchor:
            self.anchors[event.anchor] = None
        self.stack.append(_Open(place, isinstance(event, yaml.MappingStartEvent), event.anchor))

    def close(self) -> None:
        done = self.stack.pop()
        node: Node
        if done.is_table:
            entries = self.merged(done)
            size = 1 + sum(entry.node.size for entry in entries.values())
            node = Table(entries, done.location, size)
        else:
            node = Items(tuple(done.items), done.location, 1 + sum(item.size for item in done.items))
        if node.size > MOST_NODES:
            raise self.stop(done.location, "M006", f"more than {MOST_NODES} values after aliases are written out")
        self.remember(done.anchor, node)
        self.add(node, done.location)

    def merged(self, done: _Open) -> dict[str, Entry]:
        """Its entries with those of `<<` below them."""
        entries: dict[str, Entry] = {}
        for node in done.merges:
            for table in node.items if isinstance(node, Items) else (node,):
                if isinstance(table, Table):
                    entries = {**table.entries, **entries}
                else:
                    self.problems.append(Diagnostic(table.location, "M203", "`<<` takes a mapping or a list of them"))
        return {**entries, **done.entries}

    def remember(self, anchor: str | None, node: Node) -> None:
        if anchor:
            self.anchors[anchor] = node

    def refuse_tag(self, tag: str | None, place: Location) -> None:
        if tag is not None:
            short = tag.replace("tag:yaml.org,2002:", "!!")
            self.problems.append(
                Diagnostic(place, "M005", f"the tag {short} is not allowed", "write the value without it")
            )

    def add(self, node: Node, place: Location) -> None:
        self.nodes += 1
        if self.nodes > MOST_NODES:
            raise self.stop(place, "M006", f"more than {MOST_NODES} values")
        if not self.stack:
            self.root = node
            return
        top = self.stack[-1]
        if not top.is_table:
            top.items.append(node)
        elif top.key is None:
            self.start_entry(top, node, place)
        else:
            name, key = top.key
            top.key = None
            self.end_entry(top, name, key, node)

    def start_entry(self, top: _Open, node: Node, place: Location) -> None:
        if isinstance(node, Scalar):
            top.key = (str(node.value), place)
        else:
            self.problems.append(Diagnostic(place, "M002", "a key must be a single word, not a list or mapping"))
            top.key = ("?", place)

    def end_entry(self, top: _Open, name: str, key: Location, node: Node) -> None:
        if name == "<<":
            top.merges.append(node)
        elif name in top.entries:
            first = top.entries[name].key
            self.problems.append(
                Diagnostic(key, "M004", f"{name!r} is already given at line {first.line}", "remove one of the two")
            )
        else:
            top.entries[name] = Entry(key, node)
