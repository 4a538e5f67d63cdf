"""PX4 over MAVSDK: the Autopilot protocol on a real socket."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol


class Clock(Protocol):
    speed: float

    def now(self) -> float: ...

    async def sleep(self, seconds: float) -> None: ...


class MavsdkAutopilot:
    """`MavsdkAutopilot("udpin://0.0.0.0:14540", clock, simulated=False)`; implements flight.autopilot.Autopilot."""

    simulated: bool

    def __init__(
        self,
        system_address: str,
        clock: Clock,
        *,
        simulated: bool = False,
        on_status_text: Callable[[str, str], None] | None = None,
        gimbal: str = "auto",
    ) -> None:
        raise NotImplementedError
