"""The stream of setpoints: at least twenty a wall second, bounded by the keep-out volume, and only while the executive
is provably alive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from flight.autopilot import Autopilot, Setpoint
from flight.keepout import KeepOut


class Clock(Protocol):
    """What the stream needs of the executive's clock."""

    speed: float

    def now(self) -> float: ...

    async def sleep(self, seconds: float) -> None: ...


@dataclass(frozen=True)
class Sent:
    """One setpoint as it left: wall_s (monotonic, since the stream's first start), t on the executive's clock, what was
    sent and whether the keep-out volume had moved it."""

    wall_s: float
    t: float
    setpoint: Setpoint
    bounded: bool


class SetpointStream:
    """`target` is what to fly to; `keep_out` may be replaced at any time.

    The stream goes on only while `stroke()` was called within `stroke_s` wall seconds: the executive's loop does that.
    on_sent(Sent) records each; on_event(name) reports 'setpoints_stalled' (once per silence) and 'keep_out_bounded'
    (once per change from free to bounded).
    """

    target: Setpoint | None
    keep_out: KeepOut | None

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
    ) -> None:
        raise NotImplementedError

    async def start(self, first: Setpoint) -> None:
        """Begin with a first target and switch the autopilot to OFFBOARD."""

    def stop(self) -> None:
        """Stop streaming; the autopilot must already have been given another mode."""

    def stroke(self) -> None:
        """The executive's loop says that it is alive."""
