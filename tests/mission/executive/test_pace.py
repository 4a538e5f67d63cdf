"""Simulated time runs as fast as vision can follow, and is let go again after it was held back."""

from __future__ import annotations

import pytest

from mission.executive.clock import WallClock
from mission.executive.pace import SLOWEST, Pace


@pytest.mark.parametrize("fastest", (2.0, 3.0, 5.0, 7.5))
def test_runs_at_full_speed_again_once_cycles_are_short(fastest: float) -> None:
    clock = WallClock(SLOWEST)
    told: list[float] = []
    pace = Pace(clock, fastest, told.append)
    for _ in range(60):
        pace.begin()
        pace.end()
    assert clock.speed == fastest
    assert told == sorted(told) and told[-1] == fastest
