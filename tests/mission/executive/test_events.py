"""The event table: complete, every safety event ends in an abort unless somebody knows better."""

from __future__ import annotations

import pytest

from mission.behaviours.behaviour import behaviours
from mission.executive.events import EVENTS, EventError, Severity, event, fallbacks, outcomes

URGENT = [name for name, entry in EVENTS.items() if entry.severity in (Severity.SAFETY, Severity.CRITICAL)]


@pytest.mark.parametrize("name", EVENTS)
def test_every_event_says_what_it_means_and_who_raises_it(name: str) -> None:
    entry = EVENTS[name]
    assert entry.name == name and entry.text
    assert entry.raised_by in ("behaviour", "monitor", "deadline", "operator", "executive")


@pytest.mark.parametrize("name", URGENT)
def test_every_safety_event_falls_back_to_abort_or_lets_go(name: str) -> None:
    chain = fallbacks(name)
    assert chain[-1] == "abort" or EVENTS[chain[-1]].lets_go
    assert all(link in EVENTS for link in chain)


def test_critical_comes_before_safety_before_operator_before_the_ordinary() -> None:
    order = [Severity.CRITICAL, Severity.SAFETY, Severity.OPERATOR, Severity.INFO]
    assert sorted(Severity, key=lambda severity: severity.rank) == order


def test_only_a_pilot_makes_the_executive_let_go() -> None:
    assert [name for name, entry in EVENTS.items() if entry.lets_go] == ["pilot_took_over"]


def test_every_outcome_of_every_behaviour_is_an_event() -> None:
    for behaviour in behaviours().values():
        for name in behaviour.outcomes:
            assert event(name).name == name
    assert all(entry.severity is Severity.INFO for entry in outcomes().values())


def test_no_outcome_takes_the_name_of_an_event_that_others_raise() -> None:
    for behaviour in behaviours().values():
        for name in behaviour.outcomes:
            assert name not in EVENTS or EVENTS[name].raised_by == "behaviour"


def test_an_unknown_event_is_refused_in_one_line() -> None:
    with pytest.raises(EventError, match="'tea_time' is neither") as error:
        event("tea_time")
    assert "\n" not in str(error.value)
