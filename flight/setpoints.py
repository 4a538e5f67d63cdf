"""The stream of setpoints: at least twenty a wall second, bounded by the keep-out volume, and only while the executive
is provably alive."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

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
    ms; failed: how often sending one failed; unusable: how many targets were not finite numbers."""

    sent: int = 0
    longest_gap_s: float = 0.0
    gaps: int = 0
    failed: int = 0
    unusable: int = 0


class SetpointStream:
    """`target` is what to fly to; `keep_out` may be replaced at any time.

    The stream goes on only while `stroke()` was called within `stroke_s` wall seconds: the executive's loop does that,
    so that a loop which hangs in its own work, or a task that died, ends the stream as surely as a process that is
    killed. Nothing that goes wrong with one setpoint ends the stream: the next is tried in its turn. A target or a
    vehicle's position that is not finite keeps the last setpoint that was sent.

    on_sent(Sent) records each; on_event(name) reports 'setpoints_stalled' (once a silence), 'keep_out_bounded' (once a
    change from free to bounded) and 'behaviour_failed' (once a change to targets that are not finite); on_error(error)
    hears what kept a setpoint from being sent or recorded, once a silence."""

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
        on_error: Callable[[Exception], None] | None = None,
        wall: Callable[[], float] = time.monotonic,
    ) -> None:
        self.target: Setpoint | None = None
        self.keep_out = keep_out
        self.statistics = StreamStatistics()
        self._autopilot, self._clock, self._wall = autopilot, clock, wall
        self._rate_hz, self._stroke_s = rate_hz, stroke_s
        self._on_sent, self._on_event, self._on_error = on_sent, on_event, on_error
        self._task: asyncio.Task[None] | None = None
        self._stroked = self._origin = wall()
        self._last: float | None = None
        self._latest: Setpoint | None = None  # as it was sent
        self._stalled = self._failing = self._was_bounded = self._was_unusable = False
        self._failing_since: float | None = None

    @property
    def streaming(self) -> bool:
        """Whether setpoints are being sent now."""
        return self._task is not None and not self._task.done() and not (self._stalled or self._failing)

    def stroke(self) -> None:
        """The executive's loop says that it is alive."""
        self._stroked = self._wall()

    async def start(self, first: Setpoint) -> None:
        """Begin with a first target and switch the autopilot to OFFBOARD. While streaming, only the target changes.

        Raises:
            AutopilotError: OFFBOARD was refused, or where to fly to or from is not known; nothing is streamed then.
        """
        if self._task is not None and not self._task.done():
            self.target = first
            return
        bounded, _ = self._bounded(first)
        if not (_finite(first) and _finite(bounded)):
            raise AutopilotError("OFFBOARD is not begun: the vehicle's position or the first setpoint is not known")
        self.target = first
        self.stroke()
        await self._autopilot.start_offboard(bounded)
        self._last, self._latest = None, bounded
        self._stalled = self._failing = self._was_unusable = False
        self._failing_since = None
        self._try(first=True)
        self._task = asyncio.create_task(self._stream(), name="setpoints")

    def stop(self) -> None:
        """Stop streaming; the autopilot must already have been given another mode. Idempotent."""
        task, self._task = self._task, None
        self.target = self._last = self._latest = None
        if task is not None:
            task.cancel()

    async def _stream(self) -> None:
        while True:
            await self._clock.sleep(self._clock.speed / self._rate_hz)
            alive = self._wall() - self._stroked <= self._stroke_s
            if alive:
                self._stalled = False
                self._try()
            elif not self._stalled:
                self._stalled, self._last = True, None
                self._report("setpoints_stalled")

    def _try(self, first: bool = False) -> None:
        """Send one. An error is counted and told; a single one of the link is not yet a stall."""
        try:
            self._send(first)
        except Exception as error:
            now, s = self._wall(), self.statistics
            self.statistics = replace(s, failed=s.failed + 1)
            since = self._failing_since = now if self._failing_since is None else self._failing_since
            if not self._failing and (not isinstance(error, AutopilotError) or now - since > self._stroke_s):
                self._failing, self._last = True, None
                if self._on_error is not None:
                    self._on_error(error)
                self._report("setpoints_stalled")
        else:
            self._failing, self._failing_since = False, None

    def _send(self, first: bool) -> None:
        if self.target is None:
            return
        target = self.target
        unusable = not _finite(target)
        if unusable:
            s = self.statistics
            self.statistics = replace(s, unusable=s.unusable + 1)
            if not self._was_unusable:
                self._was_unusable = True
                self._report("behaviour_failed")
            if self._latest is None:
                return
            target = self._latest
        self._was_unusable = unusable
        setpoint, bounded = self._bounded(target)
        if not _finite(setpoint):  # where the vehicle is, is not known: neither is the way from there
            if self._latest is None:
                return
            setpoint = self._latest
        self._autopilot.send(setpoint)
        self._latest = setpoint
        now = self._wall()
        gap = 0.0 if self._last is None else now - self._last
        self._last = now
        s = self.statistics
        self.statistics = replace(
            s, sent=s.sent + 1, longest_gap_s=max(s.longest_gap_s, gap), gaps=s.gaps + (gap > GAP_S)
        )
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


def _finite(setpoint: Setpoint) -> bool:
    return bool(np.isfinite(setpoint.position).all() and np.isfinite(setpoint.yaw))
