"""A transition test of a mission is three lines and runs in milliseconds."""

from __future__ import annotations

from pathlib import Path

import pytest

from mission.language.simulation import SimulationError, simulate
from tests.mission.language.missions import MISSIONS, PREAMBLE, SMALL, STATES, written

V80 = MISSIONS / "v80_blade.yaml"


def test_three_lines_are_enough() -> None:
    flight = simulate(V80, at="inspect.blade.leading")
    flight.happens("vision_lost")
    assert flight.state == "inspect.reacquire"


def test_a_flight_can_be_followed_from_beginning_to_end(tmp_path: Path) -> None:
    flight = simulate(written(tmp_path, SMALL))
    for outcome in ("passed", "done", "done", "done", "landed"):
        assert flight.outcome is None
        flight.happens(outcome)
    assert flight.outcome == "completed"
    assert flight.entered == ["preflight", "launch", "work", "home", "finish", "completed"]


def test_deadlines_come_on_the_simulated_clock(tmp_path: Path) -> None:
    flight = simulate(written(tmp_path, SMALL), at="work")
    assert flight.wait(59.9).state == "work"
    assert flight.wait(0.2).state == "land"
    assert [(one.at_s, one.event) for one in flight.happenings] == [(60.0, "timed_out")]


def test_a_composite_has_a_deadline_of_its_own(tmp_path: Path) -> None:
    text = PREAMBLE + STATES.replace(
        "  work: {do: hold, with: {for_s: 5}, timeout_s: 60, on: {done: home, abort: land}}\n",
        "  work:\n    initial: a\n    timeout_s: 100\n    on: {failed: home, abort: land}\n    states:\n"
        "      a: {do: hold, timeout_s: 60, on: {done: b, failed: b}}\n"
        "      b: {do: hold, timeout_s: 60, on: {done: a, failed: a}}\n",
    )
    flight = simulate(written(tmp_path, text), at="work")
    assert flight.wait(70).state == "work.b"
    assert flight.wait(35).state == "home" and flight.happenings[-1].at_s == 100.0


def test_delayed_transitions_are_taken_in_time_and_only_where_they_belong(tmp_path: Path) -> None:
    text = SMALL.replace(
        "on: {done: home,", "on: {wind_high: {to: home, after_s: 10, unless: wind_m_s < 5}, done: home,"
    )
    path = written(tmp_path, text)
    flight = simulate(path, at="work").happens("wind_high")
    assert (flight.state, flight.happenings[-1].delayed_s) == ("work", 10.0)
    assert flight.wait(10.5).state == "home"
    calmed = simulate(path, at="work").happens("wind_high", wind_m_s=12.0)
    calmed.quantities["wind_m_s"] = 2.0
    assert calmed.wait(10.5).state == "work"  # the guard no longer holds when the time comes
    left = simulate(path, at="work").happens("wind_high").happens("done").happens("done")
    assert left.wait(11).state == "finish"  # the state that waited was left


@pytest.mark.parametrize(
    ("at", "event", "word"),
    [
        ("work", "tip_detected", "hold ends with done"),
        ("work", "vison_lost", "vision_lost"),
        ("completed", "abort", "has ended"),
        ("wrok", "abort", "work"),
    ],
)
def test_what_cannot_happen_is_refused_with_what_could(tmp_path: Path, at: str, event: str, word: str) -> None:
    with pytest.raises(SimulationError, match=word):
        simulate(written(tmp_path, SMALL), at=at).happens(event)
