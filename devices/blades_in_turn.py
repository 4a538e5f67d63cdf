"""Which blade was being inspected when: a mission may take all blades of a turbine, one after the other."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class BladesInTurn:
    """From a run's journal. The blade is counted from 0. found: blade → what was last remembered while it was flown.

    before: the blade at the beginning of the journal, for a run that goes on with another.
    """

    before: int = 0
    times: tuple[float, ...] = ()
    blades: tuple[int, ...] = ()
    found: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, journal: Iterable[Mapping[str, Any]], before: int = 0) -> BladesInTurn:
        """Read a journal's lines, in their order."""
        times, blades, found, now = [], [], {}, before
        for line in journal:
            memory = line if line.get("kind") == "memory" else line.get("memory")
            values = memory.get("values") if isinstance(memory, dict) else None
            if not isinstance(memory, dict) or not isinstance(values, dict):
                continue
            done = values.get("blades_done", 0)
            if isinstance(done, int | float) and int(done) != now:
                now = int(done)
                times.append(float(line["t"]))
                blades.append(now)
            found[now] = memory
        return cls(before, tuple(times), tuple(blades), found)

    def at(self, t: float) -> int:
        """The blade at a time (mission seconds)."""
        number = bisect_right(self.times, t)
        return self.blades[number - 1] if number else self.before

    @property
    def last(self) -> int:
        """The blade at the journal's end."""
        return self.blades[-1] if self.blades else self.before
