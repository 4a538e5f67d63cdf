"""Where something stands in a file: what every message about a mission begins with."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, order=True)
class Location:
    """A place in a file, counted from 1. For a value given on the command line `file` is that argument and `line` is
    0."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file

    def seen_from(self, file: str) -> str:
        """`line 3` in that file, `other.yaml:3` elsewhere."""
        return f"line {self.line}" if self.file == file else f"{self.file}:{self.line}"


NOWHERE = Location("", 0, 0)
