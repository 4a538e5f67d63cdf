"""What a check has to say, and how it is printed: for people, as JSON, as annotations of a pull request."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from mission.language.codes import CODES, Level
from mission.language.location import Location

_LONGEST = 600
_JOINED = re.compile(r"(?P<key>\w+)(\s*[:=]\s*|\s+)(?P<value>\S.*)")


@dataclass(frozen=True)
class Diagnostic:
    """One finding at one place. `hint` says what would be right."""

    location: Location
    code: str
    message: str
    hint: str = ""

    @property
    def level(self) -> Level:
        """Of its code."""
        return CODES[self.code].level

    def __str__(self) -> str:
        hint = f" ({self.hint})" if self.hint else ""
        return f"{printable(str(self.location))}: {self.code} {printable(self.message)}{printable(hint)}"

    def as_json(self) -> dict[str, object]:
        """The fields of `--json`."""
        return {
            "file": self.location.file,
            "line": self.location.line,
            "column": self.location.column,
            "code": self.code,
            "level": str(self.level),
            "message": printable(self.message),
            "hint": printable(self.hint),
        }

    def as_annotation(self) -> str:
        """A workflow command with which GitHub marks the line in a pull request."""
        text = f"{self.code} {printable(self.message)}" + (f" ({printable(self.hint)})" if self.hint else "")
        file = printable(self.location.file).replace("%", "%25").replace(":", "%3A").replace(",", "%2C")
        return (
            f"::{self.level} file={file},line={max(self.location.line, 1)},"
            f"col={max(self.location.column, 1)},title={self.code}::{text.replace('%', '%25')}"
        )


class MissionFileError(ValueError):
    """A mission that cannot be flown. `diagnostics` has every finding, errors first within a line; never empty."""

    def __init__(self, diagnostics: Sequence[Diagnostic]) -> None:
        self.diagnostics = tuple(diagnostics)
        super().__init__("\n".join(str(diagnostic) for diagnostic in diagnostics))


def printable(text: str) -> str:
    """Text with control characters written out and cut short, so that a file cannot play with somebody's terminal."""
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} … {text[-_LONGEST // 2 :]}"
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def suggestion(name: str, known: Iterable[str]) -> str:
    """`did you mean …?`, or an empty string where nothing is near. A key that swallowed its value is told apart."""
    names = sorted(set(known))
    if (joined := _JOINED.fullmatch(name)) and joined["key"] in names:
        return f"write {joined['key']}: {joined['value']}, with a colon and a space"
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    near = near or difflib.get_close_matches(name.lower(), names, n=1, cutoff=0.6)
    if not near and (tails := [other for other in names if other.rpartition(".")[2] == name]):
        near = tails[:1]
    return f"did you mean {near[0]}?" if near else ""


def choices(names: Iterable[str], most: int = 12) -> str:
    """`known: a, b, c`, cut short where there are many."""
    listed = sorted(set(names))
    more = f", … ({len(listed)} in all)" if len(listed) > most else ""
    return "known: " + ", ".join(listed[:most]) + more if listed else ""


def near_or_choices(name: str, known: Iterable[str]) -> str:
    """A suggestion, or else what there is to choose from."""
    names = list(known)
    return suggestion(name, names) or choices(names)


def json_report(diagnostics: Iterable[Diagnostic]) -> str:
    """All findings as one JSON document."""
    return json.dumps([diagnostic.as_json() for diagnostic in diagnostics], indent=2, ensure_ascii=False)
