"""Where an inspection goes on that was interrupted: a little before its end, and never beyond root or tip."""

from __future__ import annotations

import pytest

from mission.behaviours.approach_root import OVERLAP_M, TIP_MARGIN_M, goes_on_at
from mission.behaviours.behaviour import behaviours
from mission.behaviours.follow_edge import FollowEdge, note_progress, reached
from mission.executive.services import Memory, Stretch

ROOT_M, TIP_M = 4.0, 40.0
OUT, BACK = FollowEdge(side="leading", toward="tip"), FollowEdge(side="trailing", toward="root")


def begun(done: tuple[str, ...] = (), **inspected: tuple[float, float]) -> Memory:
    edges = {"leading": 0.6, "trailing": -0.9}
    return Memory(
        passes_done=list(done), inspected={side: Stretch(*stretch, edges[side]) for side, stretch in inspected.items()}
    )


@pytest.mark.parametrize(
    "memory, station_m, offset_m", [
        (begun(), ROOT_M, 0.0),
        (begun(leading=(4.0, 20.0)), 20.0 - OVERLAP_M, 0.1),
        (begun(leading=(4.0, 4.5)), ROOT_M, 0.1),
        (begun(leading=(4.0, 39.9)), 39.9 - OVERLAP_M, 0.1),
        (begun(("leading",), leading=(4.0, 39.5)), TIP_M - TIP_MARGIN_M, 0.1),
        (begun(("leading",), leading=(4.0, 39.5), trailing=(39.0, 15.0)), 15.0 + OVERLAP_M, -0.4),
        (begun(("leading",), leading=(4.0, 39.5), trailing=(39.0, 39.0)), TIP_M - TIP_MARGIN_M, -0.4),
        (begun(("leading", "trailing"), leading=(4.0, 39.5), trailing=(39.0, 3.0)), ROOT_M, 0.0),
    ],
)  # fmt: skip
def test_it_goes_on_a_little_before_where_it_stopped(memory: Memory, station_m: float, offset_m: float) -> None:
    assert goes_on_at(memory, ROOT_M, TIP_M) == pytest.approx((station_m, offset_m))


def test_a_part_of_a_blade_begins_where_it_was_told_to_but_never_beyond_the_tip() -> None:
    assert goes_on_at(begun(), 28.0, TIP_M) == (28.0, 0.0)
    assert goes_on_at(begun(), 60.0, TIP_M) == (TIP_M - TIP_MARGIN_M, 0.0)
    assert goes_on_at(begun(leading=(28.0, 39.9)), 28.0, TIP_M) == pytest.approx((39.9 - OVERLAP_M, 0.1))


@pytest.mark.parametrize(
    "toward, until_m, before_m, after_m", [("tip", 30.0, 29.9, 30.1), ("root", 28.0, 28.1, 27.9)]
)  # fmt: skip
def test_a_pass_ends_where_it_was_told_to(toward: str, until_m: float, before_m: float, after_m: float) -> None:
    told = FollowEdge(side="leading", toward=toward, until_m=until_m)
    assert not reached(told, before_m) and reached(told, after_m)
    assert not reached(FollowEdge(side="leading", toward=toward), after_m)


def test_a_pass_can_end_at_a_place_only_where_one_is_named() -> None:
    follow = behaviours()["follow_edge"]
    assert "station_reached" not in follow.outcomes_with(OUT)
    assert set(follow.outcomes_with(OUT.model_copy(update={"until_m": 30.0}))) == set(follow.outcomes)


def test_a_pass_remembers_how_far_it_has_come_and_never_less() -> None:
    memory = Memory()
    for station in (4.0, 4.2, 5.1, 4.8, 9.0, 8.0):
        note_progress(memory, OUT, station, 0.6)
    assert memory.inspected["leading"] == Stretch(4.0, 9.0, 0.6)
    for station in (39.0, 38.0, 38.5, 20.0, 21.0):
        note_progress(memory, BACK, station, -0.9)
    assert memory.inspected["trailing"] == Stretch(39.0, 20.0, -0.9)


def test_a_pass_that_goes_on_after_an_interruption_is_the_same_pass() -> None:
    memory = begun(leading=(4.0, 20.0))
    note_progress(memory, OUT, 18.5, 0.6)
    note_progress(memory, OUT, 22.0, 0.7)
    assert memory.inspected["leading"] == Stretch(4.0, 22.0, 0.7)
