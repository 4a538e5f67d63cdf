"""YAML text to a tree with places. The scalars follow YAML 1.2 (`on` and `no` are text), tags are refused, and hostile
text is turned away before it costs time or memory."""

from __future__ import annotations

import re

from mission.language.diagnostics import Diagnostic
from mission.language.location import Location
from mission.language.tree import Node, Scalar, Table
from mission.language.yaml_tree import CONTROL, TreeBuilder, UnreadableError, scalar_value

LONGEST_TEXT = 400_000
_INDENT_TAB = re.compile(r"^[ ]*\t\s*[^\s#]", re.MULTILINE)
_ALLOW = re.compile(r"#\s*allow(?P<everywhere> in this file)?:\s*(?P<codes>\w+(?:\s*,\s*[A-Z]\w*)*)")


def parse(text: str, file: str, problems: list[Diagnostic]) -> Table:
    """The outermost mapping of a text. Findings that leave a tree to go on with are added to `problems`.

    Raises:
        UnreadableError: there is nothing to go on with.
    """
    _refuse_controls(text, file)
    node = TreeBuilder(file, problems).build(text)
    if node is None:
        raise UnreadableError(Diagnostic(Location(file, 1, 1), "M002", "the file is empty"))
    if not isinstance(node, Table):
        raise UnreadableError(Diagnostic(node.location, "M002", "the file must be a mapping: lines of `key: value`"))
    return node


def parse_value(text: str, file: str) -> Node:
    """A single value as an override gives it; every place in it is `file`, line 0.

    Raises:
        UnreadableError: the text is not a YAML value.
    """
    problems: list[Diagnostic] = []
    _refuse_controls(text, file)
    node = TreeBuilder(file, problems, lines=False).build(text)
    if problems:
        raise UnreadableError(problems[0])
    return node if node is not None else Scalar(None, Location(file, 0, 0))


def allowances(text: str) -> dict[int, tuple[str, ...]]:
    """Line → codes that `# allow: CODE` on it wants silenced; under 0 those of `# allow in this file: CODE`."""
    found: dict[int, tuple[str, ...]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if "#" in line and (match := _ALLOW.search(line)):
            line_number = 0 if match["everywhere"] else number
            found[line_number] = (*found.get(line_number, ()), *re.split(r"\s*,\s*", match["codes"]))
    return found


def _refuse_controls(text: str, file: str) -> None:
    if match := CONTROL.search(text):
        line = text.count("\n", 0, match.start()) + 1
        column = match.start() - (text.rfind("\n", 0, match.start()) + 1) + 1
        raise UnreadableError(
            Diagnostic(Location(file, line, column), "M007", f"the control character {match.group()!r} is not allowed")
        )
    if match := _INDENT_TAB.search(text):
        line = text.count("\n", 0, match.start()) + 1
        column = match.group().index("\t") + 1
        raise UnreadableError(
            Diagnostic(Location(file, line, column), "M003", "a tab indents this line", "YAML wants spaces")
        )


__all__ = ["LONGEST_TEXT", "UnreadableError", "allowances", "parse", "parse_value", "scalar_value"]
