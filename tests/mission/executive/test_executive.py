"""What the executive promises: events in order of severity, deadlines, history, retries, and never a crash."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from typing import Any

import pytest

from mission.executive.events import EventError

END = {"completed": {"final": "completed"}, "aborted": {"final": "aborted"}, "released": {"final": "released"}}


def test_outcomes_lead_from_state_to_state_until_a_final_one(fly: Any) -> None:
    flight = fly(
        {"one": {"do": "finish", "on": {"done": "two"}}, "two": {"do": "finish", "on": {"done": "completed"}}, **END}
    )
    outcome = flight.run()
    assert (outcome.outcome, outcome.final_state, outcome.interrupted) == ("completed", "completed", False)
    assert flight.walked == ["two", "completed"]
    kinds = [kind for kind, _ in flight.journal]
    assert kinds[0] == "start" and kinds[-1] == "end"


def test_of_events_in_one_instant_the_most_severe_is_handled_first(fly: Any) -> None:
    def both(executive: Any) -> None:
        executive.raise_event("resumed")
        executive.raise_event("wind_high")
        executive.raise_event("too_close")

    flight = fly(
        {"fly": {"do": "wait", "on": {"too_close": "first", "wind_high": "aborted", "resumed": "aborted"}},
         "first": {"do": "wait", "on": {"wind_high": "second"}},
         "second": {"do": "wait", "on": {"resumed": "completed"}}, **END},
        at=[(1.0, both)],
    )  # fmt: skip
    assert flight.run().outcome == "completed"
    assert flight.walked == ["first", "second", "completed"]


def test_a_safety_event_overtakes_an_outcome_of_the_same_instant(fly: Any) -> None:
    async def both(services: Any, parameters: Any) -> str:
        await services.clock.sleep(1.0)
        services.raise_event("too_close")
        return "done"

    flight = fly(
        {"fly": {"do": "both", "on": {"done": "completed", "abort": "away"}},
         "away": {"do": "finish", "on": {"done": "aborted"}}, **END},
        {"both": both},
    )  # fmt: skip
    assert flight.run().outcome == "aborted"
    stale = [fields for kind, fields in flight.journal if kind == "event" and fields["led_to"] == "stale"]
    assert [fields["event"] for fields in stale] == ["done"]


def test_a_deadline_cancels_the_work_and_falls_back_to_abort(fly: Any) -> None:
    ended: list[float] = []

    async def endless(services: Any, parameters: Any) -> str:
        try:
            await asyncio.Event().wait()
        finally:
            ended.append(services.clock.now())
        return "done"

    flight = fly({"fly": {"do": "endless", "timeout_s": 7.5, "on": {"abort": "aborted"}}, **END}, {"endless": endless})
    assert flight.run().outcome == "aborted"
    assert ended == [pytest.approx(7.5)]


def test_a_deadline_of_a_composite_is_not_answered_by_the_states_inside(fly: Any) -> None:
    flight = fly(
        {"outer": {"timeout_s": 5.0, "on": {"timed_out": "completed"},
                   "states": {"inner": {"do": "finish", "timeout_s": 100.0, "on": {"done": "outer.more"}},
                              "more": {"do": "wait", "timeout_s": 100.0, "on": {"timed_out": "aborted"}}}}, **END}
    )  # fmt: skip
    assert flight.run().outcome == "completed"
    transitions = [fields for kind, fields in flight.journal if kind == "transition"]
    assert transitions[-1]["key"] == "outer:timed_out#0"


def test_a_deadline_nobody_answers_still_ends_the_work_and_the_vehicle_holds(fly: Any) -> None:
    flight = fly(
        {"fly": {"do": "wait", "timeout_s": 3.0, "on": {"resumed": "completed"}}, **END},
        at=[(10.0, lambda executive: executive.raise_event("resumed"))],
    )
    seen: list[Any] = []
    flight.at = [
        *flight.at,
        (9.0, lambda executive: seen.append((executive.status().behaviour, flight.services.setpoints.target))),
    ]
    assert flight.run().outcome == "completed"
    behaviour, target = seen[0]
    assert behaviour is None
    assert target.position.tolist() == [1.0, 2.0, -30.0]


@pytest.mark.parametrize("history, ends_in", [(None, "outer.a"), ("shallow", "outer.b.x"), ("deep", "outer.b.y")])
def test_history_returns_to_where_it_was(fly: Any, history: str | None, ends_in: str) -> None:
    states = {
        "outer": {
            "on": {"paused": "holding"},
            "states": {
                "a": {"do": "finish", "on": {"done": "outer.b"}},
                "b": {"states": {"x": {"do": "finish", "on": {"done": "outer.b.y"}}, "y": {"do": "wait"}}},
            },
        },
        "holding": {"on": {"resumed": {"to": "outer", "history": history}}},
        **END,
    }
    where: list[str] = []
    flight = fly(
        states,
        on={"abort": "aborted"},
        at=[
            (5.0, lambda executive: executive.raise_event("paused")),
            (6.0, lambda executive: where.append(executive.status().path)),
            (7.0, lambda executive: executive.raise_event("resumed")),
            (7.5, lambda executive: where.append(executive.status().path)),
            (8.0, lambda executive: executive.raise_event("abort")),
        ],
    )
    flight.run()
    assert where == ["holding", ends_in]


def test_retries_are_counted_and_wait_longer_each_time(fly: Any) -> None:
    entered: list[float] = []

    async def failing(services: Any, parameters: Any) -> str:
        entered.append(services.clock.now())
        return "failed"

    again = {"to": "work", "retries": 3, "backoff_s": 2.0}
    flight = fly({"work": {"do": "failing", "on": {"failed": [again, "aborted"]}}, **END}, {"failing": failing})
    assert flight.run().outcome == "aborted"
    assert [after - before for before, after in pairwise(entered)] == pytest.approx([0.0, 2.0, 4.0])


def test_a_transition_after_some_time_is_taken_then_unless_the_state_was_left(fly: Any) -> None:
    states = {"one": {"do": "wait", "on": {"resumed": {"to": "completed", "after_s": 5.0}, "step": "two"}},
              "two": {"do": "wait", "timeout_s": 30.0, "on": {"timed_out": "aborted"}}, **END}  # fmt: skip
    late = fly(states, at=[(1.0, lambda executive: executive.raise_event("resumed"))])
    assert late.run().outcome == "completed"
    left = fly(
        states,
        name="left.jsonl",
        at=[(1.0, lambda executive: executive.raise_event("resumed")), (3.0, lambda e: e.raise_event("step"))],
    )
    assert left.run().outcome == "aborted"


@pytest.mark.parametrize("kind", ["error", "unknown outcome", "exit", "cancels itself", "no text"])
def test_whatever_a_behaviour_does_is_an_event_and_never_a_crash(fly: Any, kind: str) -> None:
    async def bad(services: Any, parameters: Any) -> Any:
        await services.clock.sleep(0.5)
        if kind == "error":
            raise ValueError("the blade is\nupside down")
        if kind == "exit":
            raise SystemExit(3)
        if kind == "cancels itself":
            raise asyncio.CancelledError
        if kind == "no text":
            raise RuntimeError
        return "something else"

    flight = fly({"fly": {"do": "bad", "on": {"behaviour_failed": "aborted"}}, **END}, {"bad": bad})
    assert flight.run().outcome == "aborted"
    failed = next(fields for kind, fields in flight.journal if kind == "event")
    assert failed["event"] == "behaviour_failed" and failed["data"]["error"]


def test_a_behaviour_that_fails_at_once_and_for_ever_does_not_spin(fly: Any) -> None:
    runs = 0

    async def bad(services: Any, parameters: Any) -> str:
        nonlocal runs
        runs += 1
        raise ValueError("always")

    flight = fly(
        {"fly": {"do": "bad", "on": {"behaviour_failed": "fly", "step": "aborted"}}, **END},
        {"bad": bad},
        at=[(10.0, lambda executive: executive.raise_event("step"))],
    )
    flight.run()
    assert 2 < runs < 40


def test_a_behaviour_that_ignores_cancellation_is_abandoned_and_cannot_steer_any_more(fly: Any) -> None:
    reached = []

    async def stubborn(services: Any, parameters: Any) -> str:
        while True:
            try:
                await asyncio.sleep(1.0)
            except asyncio.CancelledError:
                reached.append("cancelled")
            if len(reached) and "steering" not in reached:
                reached.append("steering")
                services.setpoints.target = "somewhere else"
                reached.append("steered")

    seen: list[Any] = []
    flight = fly(
        {"fly": {"do": "stubborn", "on": {"abort": "away"}}, "away": {"timeout_s": 5.0, "on": {"timed_out": "aborted"}},
         **END},
        {"stubborn": stubborn},
        at=[(1.5, lambda executive: executive.raise_event("wind_high")),
            (5.0, lambda executive: seen.append(flight.services.setpoints.target))],
    )  # fmt: skip
    assert flight.run().outcome == "aborted"
    assert reached[:2] == ["cancelled", "steering"]
    assert seen[0].position.tolist() == [1.0, 2.0, -30.0]


def test_safety_events_during_a_transition_are_not_lost(fly: Any) -> None:
    async def slow_to_stop(services: Any, parameters: Any) -> str:
        try:
            await asyncio.sleep(100.0)
        finally:
            services.raise_event("too_close")
            await asyncio.sleep(0.3)
        return "done"

    flight = fly(
        {"fly": {"do": "slow", "on": {"step": "next"}}, "next": {"do": "wait", "on": {"abort": "aborted"}}, **END},
        {"slow": slow_to_stop},
        at=[(1.0, lambda executive: executive.raise_event("step"))],
    )
    assert flight.run().outcome == "aborted"
    assert flight.walked == ["next", "aborted"]


def test_an_event_outside_the_table_cannot_be_raised(fly: Any) -> None:
    async def inventive(services: Any, parameters: Any) -> str:
        services.raise_event("something_new")
        return "done"

    flight = fly({"fly": {"do": "inventive", "on": {"behaviour_failed": "aborted"}}, **END}, {"inventive": inventive})
    assert flight.run().outcome == "aborted"
    with pytest.raises(EventError, match="something_new"):
        flight.executive.raise_event("something_new")


def test_the_executive_shows_that_it_is_alive_while_it_waits(fly: Any) -> None:
    flight = fly({"fly": {"do": "wait", "timeout_s": 10.0, "on": {"timed_out": "completed"}}, **END})
    flight.run()
    assert flight.services.setpoints.strokes >= 100


def test_a_pilot_gets_the_vehicle_at_once_and_nothing_fights_for_it(fly: Any) -> None:
    tried: list[str] = []

    async def fighter(services: Any, parameters: Any) -> str:
        try:
            await asyncio.sleep(100.0)
        finally:
            for act in ("target", "offboard"):
                try:
                    if act == "target":
                        services.setpoints.target = "mine"
                    else:
                        await services.autopilot.start_offboard(None)
                    tried.append(act)
                except asyncio.CancelledError:
                    pass
        return "done"

    flight = fly(
        {"fly": {"do": "fighter"}, **END},
        {"fighter": fighter},
        on={"pilot_took_over": "released"},
        at=[(2.0, lambda executive: flight.autopilot.says(flight_mode="POSCTL"))],
    )
    assert flight.run().outcome == "released"
    assert flight.services.setpoints.target is None
    assert tried == [] and flight.autopilot.commands == []


def test_a_pilot_who_takes_over_is_never_ignored_even_if_the_mission_forgot_him(fly: Any) -> None:
    flight = fly(
        {"fly": {"do": "wait", "on": {"abort": "aborted"}}, **END},
        at=[(2.0, lambda executive: flight.autopilot.says(flight_mode="MANUAL"))],
    )
    assert flight.run().outcome == "released"


def test_an_interrupt_runs_the_abort_path_and_is_reported(fly: Any) -> None:
    flight = fly(
        {"fly": {"do": "wait", "on": {"abort": "land"}}, "land": {"do": "finish", "on": {"done": "aborted"}}, **END},
        at=[(2.0, lambda executive: executive.interrupt("SIGINT"))],
    )
    outcome = flight.run()
    assert (outcome.outcome, outcome.interrupted) == ("aborted", True)
    assert flight.walked == ["land", "aborted"]


def test_on_the_ground_an_interrupt_ends_a_mission_that_has_no_answer(fly: Any) -> None:
    flight = fly(
        {"check": {"do": "wait", "on": {"done": "completed"}}, **END},
        at=[(2.0, lambda executive: executive.interrupt())],
    )
    flight.autopilot.says(in_air=False, armed=False)
    assert flight.run().outcome == "aborted"


def test_a_limit_that_nobody_answered_is_raised_again_in_the_next_state(fly: Any) -> None:
    flight = fly(
        {"one": {"do": "wait", "timeout_s": 10.0, "on": {"timed_out": "two"}},
         "two": {"do": "wait", "on": {"battery_low": "completed"}}, **END},
        at=[(1.0, lambda executive: flight.autopilot.says(battery_percent=20.0))],
    )  # fmt: skip
    assert flight.run().outcome == "completed"


def test_a_vehicle_still_in_the_air_at_the_end_is_left_holding(fly: Any) -> None:
    flight = fly({"one": {"do": "finish", "on": {"done": "completed"}}, **END})
    flight.run()
    assert flight.autopilot.commands == ["hold"]
    assert flight.services.setpoints.target is None


def test_two_runs_leave_the_same_journal(fly: Any) -> None:
    states = {"one": {"do": "finish", "on": {"done": "two"}},
              "two": {"do": "wait", "timeout_s": 3.3, "on": {"abort": "aborted"}}, **END}  # fmt: skip
    first, second = fly(states), fly(states, name="again.jsonl")
    first.run(), second.run()
    assert first.path.read_bytes() == second.path.read_bytes()


def test_an_error_of_the_executive_itself_becomes_an_abort(fly: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    flight = fly({"one": {"do": "finish", "on": {"done": "two", "abort": "aborted"}}, "two": {"do": "wait"}, **END})
    from mission.executive.executive import Executive

    real = Executive._go

    async def broken(self: Any, queued: Any, *rest: Any) -> None:
        if queued.name == "done":
            raise ZeroDivisionError
        await real(self, queued, *rest)

    monkeypatch.setattr(Executive, "_go", broken)
    assert flight.run().outcome == "aborted"
    assert any(kind == "fault" for kind, _ in flight.journal)


@pytest.mark.parametrize("broken", ["snapshot", "monitor"])
def test_monitors_that_fail_bring_the_vehicle_home(fly: Any, monkeypatch: pytest.MonkeyPatch, broken: str) -> None:
    flight = fly({"fly": {"do": "wait", "on": {"abort": "land"}}, "land": {"do": "finish", "on": {"done": "aborted"}},
                  **END})  # fmt: skip

    def fails() -> None:
        raise ZeroDivisionError

    if broken == "snapshot":
        flight.services.perception.estimate = fails
    else:
        flight.autopilot.says(battery_percent="full")
    assert flight.run().outcome == "aborted"
    aborts = [fields for kind, fields in flight.journal if kind == "event" and fields["event"] == "abort"]
    assert len(aborts) >= 1 and "monitor" in aborts[0]["data"]


def test_a_loop_that_was_blocked_is_noticed(fly: Any) -> None:
    async def blocking(services: Any, parameters: Any) -> str:
        asyncio.get_running_loop().pass_time(3.0)  # type: ignore[attr-defined]
        await services.clock.sleep(100.0)
        return "done"

    flight = fly({"fly": {"do": "blocking", "on": {"setpoints_stalled": "aborted"}}, **END}, {"blocking": blocking})
    assert flight.run().outcome == "aborted"


def test_what_was_found_out_is_in_the_journal_before_the_state_is_left(fly: Any) -> None:
    async def finding(services: Any, parameters: Any) -> str:
        services.memory.hub = (1.0, 2.0, 3.0)
        for station in range(10):
            services.progress.station_m = float(station)
            await services.clock.sleep(1.0)
        services.memory.passes_done.append("leading")
        return "done"

    flight = fly({"fly": {"do": "finding", "on": {"done": "completed"}}, **END}, {"finding": finding})
    flight.run()
    kinds = [kind for kind, _ in flight.journal]
    assert kinds.index("memory") < kinds.index("transition")
    left = next(fields for kind, fields in flight.journal if kind == "transition")
    assert left["memory"]["passes_done"] == ["leading"]
    stations = [fields["station_m"] for kind, fields in flight.journal if kind == "progress"]
    assert stations == sorted(stations) and len(stations) >= 4
