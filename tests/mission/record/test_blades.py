"""A mission that takes several blades in turn tells of each by itself, and counts the one that was left out."""

from __future__ import annotations

from typing import Any

import pytest

from devices.blades_in_turn import BladesInTurn
from mission.record.blades import together


def memory(t: float, done: float, tip: float | None = None) -> dict[str, Any]:
    return {"t": t, "kind": "transition", "memory": {"values": {"blades_done": done}, "tip_station_m": tip}}


def test_a_photograph_belongs_to_the_blade_that_was_flown_then() -> None:
    journal = [memory(10.0, 0.0), memory(60.0, 0.0, 39.8), memory(100.0, 1.0), memory(150.0, 1.0, 40.1)]
    turns = BladesInTurn.of(journal)
    assert [turns.at(t) for t in (0.0, 99.9, 100.0, 160.0)] == [0, 0, 1, 1]
    assert [turns.found[blade]["tip_station_m"] for blade in (0, 1)] == [39.8, 40.1]
    assert BladesInTurn.of([memory(5.0, 2.0)], before=turns.last).at(4.0) == 1, "a run that goes on"


def test_a_blade_that_was_never_flown_counts_as_nothing() -> None:
    blades = [{"coverage": {"leading": 0.9, "trailing": 0.6}}, {"coverage": {"leading": 0.6}}, {"coverage": {}}]
    assert together(blades) == {"leading": pytest.approx(0.5), "trailing": pytest.approx(0.2)}
