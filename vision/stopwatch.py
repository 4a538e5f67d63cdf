"""Milliseconds per stage of a cycle, by whatever clock the caller gives: vision itself looks at none."""

from __future__ import annotations

from collections.abc import Callable

Now = Callable[[], float]  # seconds of a clock that only goes forward, such as time.perf_counter


class Stopwatch:
    """`elapsed_ms` by stage, and `total` since it was made; empty without a clock."""

    def __init__(self, now: Now | None) -> None:
        self.elapsed_ms: dict[str, float] = {}
        self._now = now
        self._last = self._first = now() if now is not None else 0.0

    def lap(self, stage: str) -> None:
        """The time since the last lap was spent on this stage."""
        if self._now is None:
            return
        now = self._now()
        self.elapsed_ms[stage] = self.elapsed_ms.get(stage, 0.0) + 1e3 * (now - self._last)
        self.elapsed_ms["total"] = 1e3 * (now - self._first)
        self._last = now
