"""The stream of setpoints: at least twenty a wall second, bounded by the keep-out volume, and only while the executive
is provably alive."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from flight.autopilot import Autopilot, AutopilotError, Setpoint
from flight.keepout import KeepOut

GAP_S = 0.15  # wall; a gap this long between two setpoints is counted


class Clock(Protocol):
    """What the stream needs of the executive's clock."""

    speed: float

    def now(self) -> float: ...

    async def sleep(self, seconds: float) -> None: ...


@dataclass(frozen=True)
class Sent:
    """One setpoint as it left: wall_s (since the stream was made), t on the executive's clock, what was sent, whether
    the keep-out volume had moved it, and whether it is the first of a stream: the time before it is no gap."""

    wall_s: float
    t: float
    setpoint: Setpoint
    bounded: bool
    first: bool = False


@dataclass(frozen=True)
class StreamStatistics:
    """sent: how many; longest_gap_s: wall seconds between two of one stretch of streaming; gaps: of those beyond 150
    ms."""

    sent: int = 0
    longest_gap_s: float = 0.0
    gaps: int = 0


class SetpointStream:
    """`target` is what to fly to; `keep_out` may be replaced at any time.

    The stream goes on only while `stroke()` was called within `stroke_s` wall seconds: the executive's loop does that,
    so that a loop which hangs in its own work, or a task that died, ends the stream as surely as a process that is
    killed. on_sent(Sent) records each; on_event(name) reports 'setpoints_stalled' (once a silence) and
    'keep_out_bounded' (once a change from free to bounded)."""

    def __init__(
        self,
        autopilot: Autopilot,
        clock: Clock,
        keep_out: KeepOut | None = None,
        *,
        rate_hz: float = 25.0,
        stroke_s: float = 0.5,
        on_sent: Callable[[Sent], None] | None = None,
        on_event: Callable[[str], None] | None = None,
        wall: Callable[[], float] = time.monotonic,
    ) -> None:
        self.target: Setpoint | None = None
        self.keep_out = keep_out
        self.statistics = StreamStatistics()
        self._autopilot, self._clock, self._wall = autopilot, clock, wall
        self._rate_hz, self._stroke_s = rate_hz, stroke_s
        self._on_sent, self._on_event = on_sent, on_event
        self._task: asyncio.Task[None] | None = None
        self._stroked = self._origin = wall()
        self._last: float | None = None
        self._stalled = self._was_bounded = False

    @property
    def streaming(self) -> bool:
        """Whether setpoints are being sent now."""
        return self._task is not None and not self._task.done() and not self._stalled

    def stroke(self) -> None:
        """The executive's loop says that it is alive."""
        self._stroked = self._wall()

    async def start(self, first: Setpoint) -> None:
        """Begin with a first target and switch the autopilot to OFFBOARD. While streaming, only the target changes.

        Raises:
            AutopilotError: OFFBOARD was refused; nothing is streamed then.
        """
        self.target = first
        if self._task is not None and not self._task.done():
            return
        bounded, _ = self._bounded(first)
        self.stroke()
        await self._autopilot.start_offboard(bounded)
        self._last = None
        self._stalled = False
        self._send(first=True)
        self._task = asyncio.create_task(self._stream(), name="setpoints")

    def stop(self) -> None:
        """Stop streaming; the autopilot must already have been given another mode. Idempotent."""
        task, self._task = self._task, None
        self.target = self._last = None
        if task is not None:
            task.cancel()

    async def _stream(self) -> None:
        while True:
            await self._clock.sleep(self._clock.speed / self._rate_hz)
            alive = self._wall() - self._stroked <= self._stroke_s
            if alive:
                self._stalled = False
                with contextlib.suppress(AutopilotError):  # the link's own monitor reports what is wrong with it
                    self._send()
            elif not self._stalled:
                self._stalled, self._last = True, None
                self._report("setpoints_stalled")

    def _send(self, first: bool = False) -> None:
        if self.target is None:
            return
        setpoint, bounded = self._bounded(self.target)
        self._autopilot.send(setpoint)
        now = self._wall()
        gap = 0.0 if self._last is None else now - self._last
        self._last = now
        s = self.statistics
        self.statistics = StreamStatistics(s.sent + 1, max(s.longest_gap_s, gap), s.gaps + (gap > GAP_S))
        if self._on_sent is not None:
            self._on_sent(Sent(now - self._origin, self._clock.now(), setpoint, bounded, first))
        if bounded and not self._was_bounded:
            self._report("keep_out_bounded")
        self._was_bounded = bounded

    def _bounded(self, setpoint: Setpoint) -> tuple[Setpoint, bool]:
        if self.keep_out is None:
            return setpoint, False
        position, bounded = self.keep_out.bound(setpoint.position, self._autopilot.telemetry.pose.position)
        return (replace(setpoint, position=position), True) if bounded else (setpoint, False)

    def _report(self, event: str) -> None:
        if self._on_event is not None:
            self._on_event(event)
