"""Is this vehicle fit to fly beside a turbine: health, battery, position, and the failsafe parameters that would
hurt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from flight.autopilot import Autopilot


@dataclass(frozen=True)
class Finding:
    """One thing looked at: a stable code, how it is, what it says and, where it is not ok, what to do about it."""

    code: str
    level: Literal["ok", "warn", "refuse"]
    text: str
    remedy: str = ""


async def check(
    autopilot: Autopilot, *, battery_percent: float, speed: float = 1.0, gimbal: bool = True
) -> list[Finding]:
    """Findings in a fixed order; the vehicle is fit where none refuses. `battery_percent` is the least to start with,
    `speed` the simulation's factor, by which PX4's start script has multiplied its time-outs."""
    raise NotImplementedError
