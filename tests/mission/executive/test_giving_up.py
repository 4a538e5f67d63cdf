"""A run always comes to an end: when the vehicle is lost for good, and when it is told twice to stop."""

from __future__ import annotations

import asyncio
import os
import signal
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mission.behaviours.motion import stay
from mission.executive.executive import Executive
from mission.executive.gate import Gate
from mission.executive.helm import Helm
from mission.executive.signals import TWICE_S, interrupting
from mission.executive.silence import GONE_S, LOST_S, Silence

FOR_EVER = {
    "fly": {"do": "wait", "on": {"abort": "abort"}},
    "abort": {"do": "wait", "timeout_s": 5.0, "on": {"timed_out": "again"}},
    "again": {"do": "wait", "timeout_s": 5.0, "on": {"timed_out": "abort"}},
    "aborted": {"final": "aborted"},
}  # fmt: skip


def falls_silent(flight: Any, at_s: float) -> list[tuple[float, Any]]:
    """From then on the link's age grows with time."""

    def silent(since: float) -> Any:
        return lambda executive: flight.autopilot.says(link_age_s=since)

    return [(at_s + step, silent(float(step))) for step in range(200)]


@pytest.mark.parametrize("gone, silent_s", [(False, LOST_S), (True, GONE_S)])
def test_a_vehicle_that_is_never_heard_again_ends_the_run_with_a_plain_reason(
    fly: Any, gone: bool, silent_s: float
) -> None:
    flight = fly(FOR_EVER)
    flight.gone, flight.at = gone, falls_silent(flight, 3.0)
    outcome = flight.run()
    assert outcome.outcome == "aborted" and not outcome.interrupted
    kind, end = flight.journal[-1]
    assert kind == "end" and end["outcome"] == "aborted"
    assert end["why"].startswith("vehicle lost")
    assert flight.executive.status().now_s == pytest.approx(3.0 + silent_s, abs=3.0)


def test_a_vehicle_that_is_heard_again_in_time_is_not_lost() -> None:
    silence = Silence()
    for second in range(300):
        assert silence.lost(float(second), float(second % 50)) is None


def test_a_loop_that_was_blocked_does_not_take_its_own_deafness_for_a_lost_vehicle() -> None:
    silence = Silence(lambda: True)
    assert silence.lost(0.0, 0.0) is None
    assert silence.lost(500.0, 500.0) is None


def test_two_flights_that_lose_the_vehicle_leave_the_same_journal(fly: Any) -> None:
    journals = []
    for name in ("first.jsonl", "second.jsonl"):
        flight = fly(FOR_EVER, name=name)
        flight.at = falls_silent(flight, 3.0)
        flight.run()
        journals.append(flight.journal)
    assert journals[0] == journals[1]


@pytest.mark.parametrize("unknown", ["position", "attitude"])
def test_where_the_vehicle_is_not_known_to_be_it_holds_the_last_target(fly: Any, unknown: str) -> None:
    flight = fly(FOR_EVER)
    last = flight.services.setpoints.target
    pose = replace(flight.autopilot.telemetry.pose, **{unknown: np.full(3, np.nan)})
    flight.autopilot.says(pose=pose)
    services = flight.services
    assert stay(services) is last and services.setpoints.target is last
    Helm(services, Gate(), lambda gap_s: None).hold()
    assert services.setpoints.target is last


def test_a_second_signal_ends_the_run_at_once_and_leaves_the_vehicle_holding(fly: Any) -> None:
    flight = fly(FOR_EVER)

    async def twice(executive: Executive) -> None:
        with interrupting(executive):
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGTERM)  # in the same instant: the same word
            while executive.state == "fly":  # noqa: ASYNC110
                await asyncio.sleep(0.01)
            assert executive.status().ended is None
            await asyncio.sleep(2 * TWICE_S)
            os.kill(os.getpid(), signal.SIGINT)
            while executive.status().ended is None:  # noqa: ASYNC110
                await asyncio.sleep(0.01)

    outcome = flight.run_on_the_wall(twice, speed=1.0)
    assert (outcome.outcome, outcome.interrupted) == ("aborted", True)
    assert flight.autopilot.commands == ["hold"]
    kind, end = flight.journal[-1]
    assert kind == "end" and "second time" in end["why"]


def test_a_vehicle_that_lands_already_is_left_to_land(fly: Any) -> None:
    flight = fly(FOR_EVER)
    flight.autopilot.says(flight_mode="LAND")
    flight.at = [(2.0, lambda executive: executive.end_now("SIGINT"))]
    assert flight.run().outcome == "aborted"
    assert flight.autopilot.commands == []
