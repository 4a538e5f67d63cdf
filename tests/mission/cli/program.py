"""Running the program as a person does."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[3]


@dataclass(frozen=True)
class Said:
    """What the program printed and its exit code."""

    code: int
    out: str
    err: str

    def assert_one_line(self, code: int) -> None:
        """An error is a single printable line, with this exit code and nothing else said."""
        assert self.code == code, (self.out, self.err)
        assert self.err.endswith("\n")
        assert self.err.count("\n") == 1, self.err
        assert self.err.rstrip("\n").isprintable()
        assert "Traceback" not in self.err
        assert "unexpected error" not in self.err


def mission(*arguments: object, cwd: Path = ROOT, env: dict[str, str] | None = None) -> Said:
    """`mission ARGUMENTS…` in a process of its own, without a terminal."""
    done = subprocess.run(
        [sys.executable, "-m", "mission", *map(str, arguments)],
        cwd=cwd, env={**os.environ, **(env or {})}, stdin=subprocess.DEVNULL, capture_output=True, text=True,
        timeout=100, check=False,
    )  # fmt: skip
    return Said(done.returncode, done.stdout, done.stderr)
