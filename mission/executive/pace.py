"""How fast simulated time may run: never faster than vision can look."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from mission.executive.clock import WallClock

CYCLE_S = 0.35  # mission seconds that a cycle of vision may take on the average before time is slowed down
SLOWEST = 1.0
EASE = 1.1  # faster again by at most this factor a cycle
STEP = 0.05  # of the speed: less than EASE raises it by; smaller changes are not worth making
PERIOD_S = 0.05


@dataclass
class Pace:
    """Slows the simulation down on a busy machine, and lets it go again, up to `fastest`.

    A vehicle that flies at four times real time before eyes that look twice a second flies half blind, which no real
    one does. `change` tells the simulated vehicle; the clock follows in the same instant.
    """

    clock: WallClock
    fastest: float
    change: Callable[[float], object]
    _average_s: float | None = field(default=None)
    _began_s: float | None = field(default=None)

    def begin(self) -> None:
        """A cycle of vision begins."""
        self._began_s = time.monotonic()

    def end(self) -> None:
        """It has ended; choose the speed by how long cycles take."""
        if self._began_s is None:
            return
        took, self._began_s = time.monotonic() - self._began_s, None
        self._average_s = took if self._average_s is None else 0.8 * self._average_s + 0.2 * took
        self._choose(min(self.fastest, CYCLE_S / max(self._average_s, 1e-3), self.clock.speed * EASE))

    async def run(self) -> None:
        """Slow down at once when one cycle takes far too long; until cancelled."""
        while True:
            await asyncio.sleep(PERIOD_S)
            if self._began_s is not None and time.monotonic() - self._began_s > 2 * CYCLE_S / self.clock.speed:
                self._choose(SLOWEST)

    def _choose(self, speed: float) -> None:
        speed = max(speed, min(SLOWEST, self.fastest))
        if abs(speed - self.clock.speed) > STEP * self.clock.speed or (speed == self.fastest != self.clock.speed):
            self.change(speed)
            self.clock.change_speed(speed)
