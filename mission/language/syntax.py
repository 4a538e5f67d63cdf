"""Where a syntax error really is: a parser notices an open quote or bracket, or a missing colon, lines later."""

from __future__ import annotations

import re

import yaml

from mission.language.diagnostics import Diagnostic
from mission.language.location import Location


def syntax_error(
    error: yaml.MarkedYAMLError, text: str, file: str, wide: tuple[Location, int] | None, counted: bool
) -> Diagnostic:
    """What a parser's error says of a text, at the line where the mistake was made.

    wide: where the last text in quotes that goes on over several lines begins, and its last line. counted: without it
    there are no lines to name.
    """
    context, problem = error.context or "", error.problem or "not YAML"
    here = error.problem_mark or error.context_mark
    if not counted or here is None:
        return Diagnostic(Location(file, 0 if not counted else 1, 0 if not counted else 1), "M002", problem)
    if wide is not None and here.line + 1 == wide[1]:
        message = f"the quote that opens here is closed in line {wide[1]}"
        return Diagnostic(wide[0], "M002", message, "close it where its text ends")
    began = any(word in context for word in ("flow", "quoted", "simple key", "anchor", "alias"))
    mark = error.context_mark if began and error.context_mark else here
    line, column, lines = mark.line + 1, mark.column + 1, text.splitlines()
    if line > len(lines) > 0:
        line, column = len(lines), 1
    if problem.startswith("mapping values") and (keyless := _keyless_line_above(lines, line)):
        message = "a `:` with a space after it is missing here, or the next line is indented too far"
        return Diagnostic(Location(file, keyless, 1), "M002", message)
    return Diagnostic(Location(file, line, column), "M002", f"{context + ': ' if context else ''}{problem}")


def _keyless_line_above(lines: list[str], number: int) -> int | None:
    """The line before `number` with something on it, where it is no `key: value` line; counted from 1."""
    for above in range(number - 1, 0, -1):
        content = lines[above - 1].strip()
        if content and not content.startswith("#"):
            return None if re.search(r":(\s|$)", content) else above
    return None
