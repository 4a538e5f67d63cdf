"""The setpoint stream: who keeps it going, what bounds it, what it remembers."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest

from flight.autopilot import AutopilotError, Setpoint
from flight.keepout import KeepOut
from flight.setpoints import SetpointStream
from flight.turbine import Turbine
from mission.executive.clock import LockstepClock, LockstepLoop
from tests.flight.fake_autopilot import FakeAutopilot

FIRST = Setpoint(np.array([0.0, 0.0, -20.0]), 0.1)


class Rig:
    """A stream on a loop whose time is simulated; the wall clock is the loop's time too."""

    def __init__(self, keep_out: KeepOut | None = None, **options) -> None:
        self.autopilot = FakeAutopilot()
        self.sent, self.events = [], []
        self.stream = SetpointStream(
            self.autopilot,
            LockstepClock(),
            keep_out,
            on_sent=self.sent.append,
            on_event=self.events.append,
            wall=lambda: asyncio.get_running_loop().time(),
            **options,
        )

    async def live(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            self.stream.stroke()
            await asyncio.sleep(0.1)


def run(story) -> None:
    loop = LockstepLoop()
    try:
        loop.run_until_complete(story())
        for task in asyncio.all_tasks(loop):
            task.cancel()
        loop.run_until_complete(asyncio.sleep(0))
    finally:
        loop.close()


def test_setpoints_go_out_at_more_than_twenty_a_second_while_the_executive_lives():
    async def story() -> None:
        rig = Rig()
        await rig.stream.start(FIRST)
        await rig.live(2.0)
        assert len(rig.autopilot.sent) >= 40
        assert max(np.diff([s.wall_s for s in rig.sent])) <= 0.05
        assert rig.stream.statistics.gaps == 0
        assert rig.stream.streaming

    run(story)


def test_without_a_stroke_the_stream_stops_within_half_a_second_and_says_so_once():
    async def story() -> None:
        rig = Rig()
        await rig.stream.start(FIRST)
        await rig.live(1.0)
        await asyncio.sleep(3.0)
        assert rig.sent[-1].wall_s <= 1.0 + 0.5
        assert rig.events == ["setpoints_stalled"]
        assert not rig.stream.streaming

    run(story)


def test_with_the_next_stroke_it_goes_on_and_the_silence_is_no_gap_of_streaming():
    async def story() -> None:
        rig = Rig()
        await rig.stream.start(FIRST)
        await asyncio.sleep(3.0)
        silent = len(rig.sent)
        await rig.live(1.0)
        assert len(rig.sent) > silent + 15
        assert rig.stream.statistics.longest_gap_s < 0.1

    run(story)


def test_a_late_loop_is_counted_as_a_gap():
    async def story() -> None:
        rig = Rig(rate_hz=4.0)
        await rig.stream.start(FIRST)
        await rig.live(1.0)
        assert rig.stream.statistics.gaps >= 3
        assert rig.stream.statistics.longest_gap_s == pytest.approx(0.25)

    run(story)


def test_the_target_may_change_at_any_time():
    async def story() -> None:
        rig = Rig()
        await rig.stream.start(FIRST)
        other = Setpoint(np.array([1.0, 2.0, -30.0]), 0.2)
        rig.stream.target = other
        await rig.live(0.2)
        assert rig.autopilot.sent[-1] is other
        await rig.stream.start(FIRST)
        await rig.live(0.1)
        assert rig.autopilot.sent[-1] is FIRST
        assert rig.autopilot.offboard_starts == 1

    run(story)


def test_after_stop_nothing_is_sent():
    async def story() -> None:
        rig = Rig()
        await rig.stream.start(FIRST)
        rig.stream.stop()
        rig.stream.stop()
        count = len(rig.autopilot.sent)
        await rig.live(1.0)
        assert len(rig.autopilot.sent) == count
        assert rig.stream.target is None

    run(story)


def test_a_refused_offboard_streams_nothing():
    async def story() -> None:
        rig = Rig()
        rig.autopilot.refuses = True
        with pytest.raises(AutopilotError):
            await rig.stream.start(FIRST)
        await rig.live(0.5)
        assert rig.autopilot.sent == []

    run(story)


def test_a_lost_link_does_not_end_the_stream():
    async def story() -> None:
        rig = Rig()
        await rig.stream.start(FIRST)
        rig.autopilot.refuses = True
        await rig.live(0.5)
        rig.autopilot.refuses = False
        count = len(rig.autopilot.sent)
        await rig.live(0.5)
        assert len(rig.autopilot.sent) > count + 5

    run(story)


def test_every_setpoint_is_bounded_from_the_first_on_and_each_encounter_told_once():
    async def story() -> None:
        keep_out = KeepOut(Turbine(np.array([60.0, 0.0, -78.0]), 0.0, 0.5, hub_sigma_m=0.5))
        rig = Rig(keep_out)
        rig.autopilot.move_to(np.array([20.0, 10.0, -70.0]))
        into = Setpoint(np.array([60.0, 10.0, -70.0]), 0.0)
        await rig.stream.start(into)
        await rig.live(0.5)
        assert rig.events == ["keep_out_bounded"]
        assert all(sent.bounded for sent in rig.sent)
        rig.stream.target = Setpoint(np.array([20.0, 0.0, -70.0]), 0.0)
        await rig.live(0.3)
        rig.stream.target = into
        await rig.live(0.3)
        assert rig.events == ["keep_out_bounded"] * 2
        assert not any(keep_out.inside(setpoint.position) for setpoint in [*rig.autopilot.started, *rig.autopilot.sent])

    run(story)


def test_an_unexpected_error_of_one_setpoint_is_told_once_and_the_next_are_sent():
    async def story() -> None:
        errors: list[Exception] = []
        rig = Rig(on_error=errors.append)
        await rig.stream.start(FIRST)
        send, rig.autopilot.send = rig.autopilot.send, lambda setpoint: setpoint.nothing
        await rig.live(0.5)
        assert rig.events == ["setpoints_stalled"]
        assert [type(error) for error in errors] == [AttributeError]
        assert rig.stream.statistics.failed >= 10
        assert not rig.stream.streaming
        rig.autopilot.send = send
        count = len(rig.autopilot.sent)
        await rig.live(0.5)
        assert len(rig.autopilot.sent) >= count + 10
        assert rig.stream.streaming
        assert rig.events == ["setpoints_stalled"]

    run(story)


def test_a_link_that_refuses_setpoints_for_long_is_told_too():
    async def story() -> None:
        rig = Rig()
        await rig.stream.start(FIRST)
        rig.autopilot.refuses = True
        await rig.live(2.0)
        assert rig.events == ["setpoints_stalled"]

    run(story)


@pytest.mark.parametrize(
    "wrong", [Setpoint(np.array([np.nan, 0.0, -20.0]), 0.1), Setpoint(np.array([1.0, 0.0, -20.0]), np.inf)]
)
def test_a_target_that_is_not_finite_keeps_the_last_setpoint_and_is_told_once(wrong):
    async def story() -> None:
        keep_out = KeepOut(Turbine(np.array([60.0, 0.0, -78.0]), 0.0, 0.5, hub_sigma_m=0.5))
        rig = Rig(keep_out)
        rig.autopilot.move_to(np.array([0.0, 0.0, -20.0]))
        await rig.stream.start(FIRST)
        rig.stream.target = wrong
        await rig.live(0.5)
        assert rig.events == ["behaviour_failed"]
        assert rig.stream.statistics.unusable >= 10
        assert len(rig.autopilot.sent) >= 10
        assert all(setpoint is FIRST for setpoint in rig.autopilot.sent)

    run(story)


def test_while_the_position_is_unknown_no_target_is_followed_past_the_keep_out_volume():
    async def story() -> None:
        keep_out = KeepOut(Turbine(np.array([60.0, 0.0, -78.0]), 0.0, 0.5, hub_sigma_m=0.5))
        rig = Rig(keep_out)
        rig.autopilot.move_to(np.array([0.0, 0.0, -20.0]))
        await rig.stream.start(FIRST)
        rig.autopilot.move_to(np.full(3, np.nan))
        rig.stream.target = Setpoint(np.array([60.0, 10.0, -70.0]), 0.0)
        await rig.live(0.5)
        assert len(rig.autopilot.sent) >= 10
        assert all(setpoint is FIRST for setpoint in rig.autopilot.sent)

    run(story)


def test_nothing_is_begun_from_an_unknown_position_beside_the_keep_out_volume():
    async def story() -> None:
        rig = Rig(KeepOut(Turbine(np.array([60.0, 0.0, -78.0]), 0.0, 0.5, hub_sigma_m=0.5)))
        rig.autopilot.move_to(np.full(3, np.nan))
        with pytest.raises(AutopilotError, match="not known"):
            await rig.stream.start(FIRST)
        assert rig.autopilot.started == [] and rig.stream.target is None

    run(story)
