"""Milliseconds per stage of a cycle: the one place where vision looks at a clock, and it decides nothing by it."""

from __future__ import annotations

import time


class Stopwatch:
    """`elapsed_ms` by stage, and `total` since it was made."""

    def __init__(self) -> None:
        self.elapsed_ms: dict[str, float] = {}
        self._last = self._first = time.perf_counter()

    def lap(self, stage: str) -> None:
        """The time since the last lap was spent on this stage."""
        now = time.perf_counter()
        self.elapsed_ms[stage] = self.elapsed_ms.get(stage, 0.0) + 1e3 * (now - self._last)
        self.elapsed_ms["total"] = 1e3 * (now - self._first)
        self._last = now
