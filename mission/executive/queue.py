"""The queue of events: critical ones first, then safety, operator and ordinary ones, each kind by arrival."""

from __future__ import annotations

import asyncio
import heapq
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mission.executive.events import event
from mission.language.document import Transition


@dataclass(frozen=True, order=True)
class Queued:
    """An event that waits. `activation`: the run of a behaviour it comes from; it means nothing once that has ended.

    origin: the state that it is about, where that is not the active leaf. only: the transition it may lead to.
    """

    rank: int
    number: int
    name: str = field(compare=False)
    data: Mapping[str, Any] = field(compare=False, default_factory=dict)
    activation: int | None = field(compare=False, default=None)
    origin: str | None = field(compare=False, default=None)
    only: Transition | None = field(compare=False, default=None)
    confirmed: bool = field(compare=False, default=False)


class EventQueue:
    """Events that wait, and a way to wait for one."""

    def __init__(self) -> None:
        self._heap: list[Queued] = []
        self._number = 0
        self.arrived = asyncio.Event()

    def __len__(self) -> int:
        return len(self._heap)

    def put(self, name: str, data: Mapping[str, Any] | None = None, **about: Any) -> Queued:
        """Queue an event of the table, or an outcome.

        Raises:
            EventError: nobody declared it.
        """
        self._number += 1
        queued = Queued(event(name).severity.rank, self._number, name, dict(data or {}), **about)
        heapq.heappush(self._heap, queued)
        self.arrived.set()
        return queued

    def pop(self) -> Queued | None:
        """The most urgent one; None where none waits."""
        if not self._heap:
            self.arrived.clear()
            return None
        return heapq.heappop(self._heap)
