"""`${name}`: values that stand in `parameters` and are used elsewhere. The nearest `parameters` around the place
counts."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from mission.language.diagnostics import Diagnostic, near_or_choices
from mission.language.location import Location
from mission.language.tree import Entry, Items, Node, Scalar, Table
from mission.language.yaml_tree import DEEPEST, MOST_NODES

_REFERENCE = re.compile(r"\$\{(?P<name>[^{}]*)\}")
_NAME = re.compile(r"[A-Za-z_]\w*")
_LONGEST = 10_000


@dataclass
class _Scope:
    """One `parameters` mapping. resolving: names on the way, to notice circles."""

    table: Table
    outer: _Scope | None
    used: set[str] = field(default_factory=set)
    resolved: dict[str, Node] = field(default_factory=dict)
    resolving: list[str] = field(default_factory=list)


def resolve(root: Table, problems: list[Diagnostic]) -> Table:
    """The same tree without references; each value keeps the place of the parameter it came from and of its use.

    Reports references to nothing, circles, malformed ones, and parameters that nobody uses.
    """
    resolver = _Resolver(problems)
    node = resolver.inside(root, None)
    for scope in resolver.scopes:
        for name, entry in scope.table.entries.items():
            if name not in scope.used:
                problems.append(Diagnostic(entry.key, "M107", f"the parameter {name!r} is never used"))
    assert isinstance(node, Table)
    return node


class _Resolver:
    def __init__(self, problems: list[Diagnostic]) -> None:
        self.problems = problems
        self.scopes: list[_Scope] = []
        self.depth = 0

    def inside(self, node: Node, scope: _Scope | None) -> Node:
        if isinstance(node, Scalar):
            return self.scalar(node, scope)
        if isinstance(node, Items):
            items = tuple(self.inside(item, scope) for item in node.items)
            size = self.bounded(1 + sum(item.size for item in items), node.location)
            return Items(items if size else (), node.location, size)
        parameters = node.get("parameters")
        inner = scope
        if isinstance(parameters, Table):
            inner = _Scope(parameters, scope)
            self.scopes.append(inner)
        entries: dict[str, Entry] = {}
        for key, entry in node.entries.items():
            if key == "parameters" and isinstance(parameters, Table) and inner is not None:
                values = {name: Entry(e.key, self.parameter(name, inner)) for name, e in parameters.entries.items()}
                size = self.bounded(1 + sum(value.node.size for value in values.values()), parameters.location)
                entries[key] = Entry(entry.key, Table(values if size else {}, parameters.location, size))
            else:
                entries[key] = Entry(entry.key, self.inside(entry.node, inner), entry.first)
        size = self.bounded(1 + sum(entry.node.size for entry in entries.values()), node.location)
        return Table(entries if size else {}, node.location, size)

    def bounded(self, size: int, place: Location) -> int:
        """The same size, 0 with a finding where references make it grow beyond what a file may hold."""
        if size <= MOST_NODES:
            return size
        self.problems.append(Diagnostic(place, "M006", f"more than {MOST_NODES} values after references are replaced"))
        return 0

    def parameter(self, name: str, scope: _Scope) -> Node:
        if name not in scope.resolved:
            entry = scope.table.entries[name]
            if name in scope.resolving:
                self.problems.append(Diagnostic(entry.key, "M105", f"the parameter {name!r} leads back to itself"))
                return Scalar(None, entry.node.location)
            if self.depth >= DEEPEST:
                message = f"references lead through more than {DEEPEST} parameters"
                self.problems.append(Diagnostic(entry.key, "M105", message))
                return Scalar(None, entry.node.location)
            scope.resolving.append(name)
            self.depth += 1
            scope.resolved[name] = self.inside(entry.node, scope)
            self.depth -= 1
            scope.resolving.remove(name)
        return scope.resolved[name]

    def scalar(self, node: Scalar, scope: _Scope | None) -> Node:
        text = node.value
        if not isinstance(text, str) or "$" not in text:
            return node
        found = list(_REFERENCE.finditer(text))
        if not found:
            if "${" in text or re.search(r"\$\w", text):
                self.problems.append(Diagnostic(node.location, "M105", f"{text!r} is no reference", "write ${name}"))
            return node
        if len(found) == 1 and found[0].span() == (0, len(text)):
            value = self.looked_up(found[0]["name"], node.location, scope)
            if isinstance(value, Scalar):
                return Scalar(value.value, value.location, value.offset, used_at=node.location)
            return value if value is not None else Scalar(None, node.location, used_at=node.location)
        parts: list[str] = []
        end = 0
        for match in found:
            value = self.looked_up(match["name"], node.location, scope)
            if isinstance(value, Items | Table):
                self.problems.append(
                    Diagnostic(node.location, "M105", f"the parameter {match['name']!r} does not fit into a text")
                )
            inserted = value.value if isinstance(value, Scalar) else ""
            parts += [text[end : match.start()], str(inserted).lower() if isinstance(inserted, bool) else str(inserted)]
            end = match.end()
        whole = "".join([*parts, text[end:]])
        if len(whole) > _LONGEST:
            self.problems.append(Diagnostic(node.location, "M006", f"a text of more than {_LONGEST} characters"))
        return Scalar(whole[:_LONGEST], node.location, node.offset)

    def looked_up(self, name: str, place: Location, scope: _Scope | None) -> Node | None:
        if not _NAME.fullmatch(name):
            self.problems.append(Diagnostic(place, "M105", f"{name!r} is not a parameter's name", "write ${name}"))
            return None
        known: list[str] = []
        # Inside its own definition a name means the outer one: `parameters: {speed_m_s: "${speed_m_s}"}` passes it on.
        while scope is not None:
            known += scope.table.entries
            if name in scope.table.entries and not (name in scope.resolving and scope.outer is not None):
                scope.used.add(name)
                return self.parameter(name, scope)
            scope = scope.outer
        hint = near_or_choices(name, known) if known else "the mission has no parameters"
        self.problems.append(Diagnostic(place, "M104", f"there is no parameter {name!r}", hint))
        return None
