"""The rules of the hierarchical machine: who answers, what is left and entered, what history remembers."""

from __future__ import annotations

from pathlib import Path

import pytest

from mission.language import semantics
from mission.language.document import Mission, load
from mission.language.semantics import Configuration
from tests.mission.language.missions import PREAMBLE, written

TEXT = (
    PREAMBLE
    + """\
initial: ground
on: {pilot_took_over: released}
states:
  ground: {do: take_off, timeout_s: 60, on: {done: outer, failed: landing, abort: landing}}
  outer:
    initial: first
    timeout_s: 900
    on: {abort: landing, paused: waiting, battery_low: [{to: first, when: battery_percent > 20}, landing]}
    states:
      first:
        do: hold
        timeout_s: 60
        on: {done: inner, paused: second, vision_lost: {to: second, retries: 2, backoff_s: 3}}
      inner:
        initial: second
        on: {done: first, wind_high: inner}
        states:
          second: {do: hold, timeout_s: 60, on: {done: third}}
          third: {do: hold, timeout_s: 60, on: {gps_degraded: {to: outer, after_s: 5}}}
      second: {do: hold, timeout_s: 60, on: {done: {to: first, retries: 9}}}
  waiting:
    do: hold
    timeout_s: 60
    on: {resumed: {to: outer, history: deep}, step: {to: outer, history: shallow}, done: outer, abort: landing}
  landing: {do: land, timeout_s: 60, on: {landed: aborted, failed: landing}}  # allow: M305
  aborted: {final: true, outcome: aborted}
  released: {final: true, outcome: released}
"""
)


@pytest.fixture
def mission(tmp_path: Path) -> Mission:
    return load(written(tmp_path, TEXT))


def happened(mission: Mission, leaf: str, event: str, **quantities: float) -> str | None:
    """Where an event leads from a leaf."""
    configuration = Configuration(leaf)
    transition = semantics.choose(mission, configuration, event, quantities)
    return None if transition is None else semantics.take(mission, configuration, transition, event).after.leaf


@pytest.mark.parametrize(
    ("leaf", "event", "target"),
    [
        ("outer.first", "paused", "outer.second"),  # the inner entry wins, and its name is sought nearest first
        ("outer.second", "paused", "waiting"),  # the outer one answers where there is no inner one
        ("outer.inner.second", "done", "outer.inner.third"),
        ("outer.inner.third", "done", "outer.first"),
        ("outer.inner.third", "wind_high", "outer.inner.second"),  # a composite is left and entered again
        ("outer.inner.third", "too_close", "landing"),  # falls back to abort
        ("outer.inner.third", "timed_out", "landing"),  # through failed to abort
        ("landing", "too_close", None),
        ("landing", "behaviour_failed", "landing"),
        ("landing", "pilot_took_over", "released"),
        ("landing", "vehicle_failsafe", "released"),
        ("waiting", "resumed", "outer.first"),  # no history yet: where it begins
        ("outer.second", "link_restored", None),
    ],
)
def test_the_right_state_answers(mission: Mission, leaf: str, event: str, target: str | None) -> None:
    assert happened(mission, leaf, event) == target


def test_the_first_entry_whose_guard_holds_answers(mission: Mission) -> None:
    assert happened(mission, "outer.second", "battery_low", battery_percent=30.0) == "outer.first"
    assert happened(mission, "outer.second", "battery_low", battery_percent=10.0) == "landing"
    assert happened(mission, "outer.second", "battery_low") == "landing"


def test_states_are_left_from_within_and_entered_from_without(mission: Mission) -> None:
    configuration = Configuration("outer.inner.third")
    step = semantics.take(mission, configuration, semantics.choose(mission, configuration, "abort", {}))
    assert step.exited == ("outer.inner.third", "outer.inner", "outer") and step.entered == ("landing",)
    step = semantics.take(mission, configuration, semantics.choose(mission, configuration, "done", {}))
    assert step.exited == ("outer.inner.third", "outer.inner") and step.entered == ("outer.first",)
    step = semantics.take(mission, configuration, semantics.choose(mission, configuration, "wind_high", {}))
    assert step.exited == ("outer.inner.third", "outer.inner")
    assert step.entered == ("outer.inner", "outer.inner.second")


def test_history_returns_to_where_it_was_deep_or_to_the_same_child(mission: Mission) -> None:
    there = Configuration("outer.inner.third")
    away = semantics.take(mission, there, semantics.choose(mission, there, "paused", {})).after
    deep = semantics.take(mission, away, semantics.choose(mission, away, "resumed", {})).after
    shallow = semantics.take(mission, away, semantics.choose(mission, away, "step", {})).after
    plain = semantics.take(mission, away, semantics.choose(mission, away, "done", {})).after
    assert (deep.leaf, shallow.leaf, plain.leaf) == ("outer.inner.third", "outer.inner.second", "outer.first")


def test_used_up_retries_pass_the_event_on_and_back_off_doubles(mission: Mission) -> None:
    configuration, delays, targets = Configuration("outer.first"), [], []
    for _ in range(3):
        transition = semantics.choose(mission, configuration, "vision_lost", {})
        delays.append(semantics.delay_s(transition, configuration))
        after = semantics.take(mission, configuration, transition, "vision_lost").after
        targets.append(after.leaf)
        configuration = Configuration("outer.first", after.history, after.taken)
    assert targets == ["outer.second", "outer.second", "landing"]
    assert delays == [0.0, 3.0, 0.0]


def test_the_deadline_of_a_composite_is_answered_from_the_composite_outward(mission: Mission) -> None:
    configuration = Configuration("outer.inner.third")
    transition = semantics.choose(mission, configuration, "timed_out", {}, origin="outer")
    assert transition is not None and transition.source == "outer" and transition.target == "landing"
