"""The executive's own hands on the vehicle: hold where it is, let go, and prove all the time that somebody steers."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from flight.autopilot import Setpoint
from mission.executive.gate import Gate

if TYPE_CHECKING:
    from mission.executive.services import Services

PULSE_S = 0.1  # of the event loop: the executive shows at least this often that it is alive
STALLED_S = 0.8  # of the event loop: after such a gap the autopilot may have left OFFBOARD
_LAST_HOLD_S = 5.0
_COMING_DOWN = ("LAND", "RTL")


class Helm:
    """Steers past the gate. `stalled(gap_s)` is told when the event loop was blocked while setpoints were wanted."""

    def __init__(self, services: Services, gate: Gate, stalled: Callable[[float], None]) -> None:
        """services: before they are put behind the gate."""
        self._autopilot, self._setpoints, self._perception = services.autopilot, services.setpoints, services.perception
        self._log, self._gate, self._stalled = services.log, gate, stalled
        self._commanded = services.commanded
        self._beaten_s: float | None = None

    def beat(self) -> None:
        """Say that the executive is alive; notice if it was not."""
        now = asyncio.get_running_loop().time()
        gap = 0.0 if self._beaten_s is None else now - self._beaten_s
        self._beaten_s = now
        if gap > STALLED_S and self._setpoints.target is not None:
            self._stalled(round(gap, 2))
        stroke = getattr(self._setpoints, "stroke", None)
        if stroke is not None:
            stroke()

    async def patiently(self, awaitable: Awaitable[Any], at_most_s: float = float("inf")) -> None:
        """Wait without appearing dead, for `at_most_s` of the event loop. What the gate has stopped is over, and no
        error."""
        task = asyncio.ensure_future(awaitable)
        until = asyncio.get_running_loop().time() + at_most_s
        while not task.done() and asyncio.get_running_loop().time() < until:
            self.beat()
            await asyncio.wait([task], timeout=PULSE_S)
        if task.done() and not task.cancelled():
            task.result()

    def hold(self) -> None:
        """Stay here, if setpoints are being sent at all; where the vehicle is not known to be, at the last target."""
        if self._gate.let_go or self._setpoints.target is None:
            return
        pose = self._autopilot.telemetry.pose
        if not (np.isfinite(pose.position).all() and np.isfinite(pose.attitude[2])):
            return
        self._setpoints.target = Setpoint(pose.position.copy(), float(pose.attitude[2]))

    def let_go(self) -> None:
        """Somebody else flies: no setpoint and no command from now on, and no laser."""
        if self._gate.let_go:
            return
        self._gate.let_go = True
        self._setpoints.stop()
        with suppress(Exception):
            self._perception.watch_blade(False)
        self._log.warning("let go of the vehicle")

    async def leave(self) -> None:
        """At the end: a vehicle that is still in the air, and ours, is left in the autopilot's own hold, or landing."""
        if self._gate.let_go:
            return
        ours = self._commanded.took_over or self._setpoints.target is not None
        with suppress(Exception):
            telemetry = self._autopilot.telemetry
            if ours and telemetry.in_air and telemetry.flight_mode not in _COMING_DOWN:
                await self.patiently(asyncio.wait_for(self._autopilot.hold(), _LAST_HOLD_S))
        self._setpoints.stop()
