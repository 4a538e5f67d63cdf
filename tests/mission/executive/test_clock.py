"""Time: wall time scaled, and lockstep time that moves only when everybody waits."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Coroutine
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.executive.clock import LockstepClock, LockstepLoop, WallClock


def run(flight: Coroutine[Any, Any, Any], advance: Any = lambda seconds: None) -> Any:
    with asyncio.Runner(loop_factory=lambda: LockstepLoop(advance)) as runner:
        return runner.run(flight)


def test_lockstep_time_passes_while_everybody_sleeps() -> None:
    clock = LockstepClock()
    run(clock.sleep(3600.0))
    assert clock.now() == pytest.approx(3600.0)


@given(st.lists(st.floats(0.0, 100.0), min_size=1, max_size=20))
def test_the_world_advances_by_exactly_what_is_slept(sleeps: list[float]) -> None:
    steps: list[float] = []
    clock = LockstepClock()

    async def sleeper(seconds: float) -> float:
        await clock.sleep(seconds)
        return clock.now()

    async def all_of_them() -> list[float]:
        return await asyncio.gather(*(sleeper(seconds) for seconds in sleeps))

    woken = run(all_of_them(), steps.append)
    assert woken == pytest.approx(sleeps, abs=1e-6)
    assert sum(steps) == pytest.approx(max(sleeps), abs=1e-6)
    assert all(step >= 0 for step in steps)


def test_sleepers_wake_in_the_order_of_their_deadlines_and_the_same_in_every_run() -> None:
    def once() -> list[int]:
        clock, order = LockstepClock(), []

        async def sleeper(number: int, seconds: float) -> None:
            await clock.sleep(seconds)
            order.append(number)

        async def all_of_them() -> None:
            await asyncio.gather(*(sleeper(n, s) for n, s in enumerate((0.3, 0.1, 0.2, 0.1, 0.0))))

        run(all_of_them())
        return order

    assert once() == once() == [4, 1, 3, 2, 0]


def test_a_lockstep_loop_that_can_never_go_on_says_so_instead_of_hanging() -> None:
    async def stuck() -> None:
        await asyncio.Event().wait()

    loop = LockstepLoop()
    with pytest.raises(RuntimeError, match="every task waits"):
        loop.run_until_complete(stuck())
    for task in asyncio.all_tasks(loop):
        task.cancel()
    loop.run_until_complete(asyncio.sleep(0))
    loop.close()


def test_lockstep_work_is_done_at_once_and_its_error_comes_back() -> None:
    clock = LockstepClock()

    def fails() -> None:
        raise ValueError("no image")

    async def work() -> float:
        assert await clock.work(threading.current_thread) is threading.current_thread()
        with pytest.raises(ValueError, match="no image"):
            await clock.work(fails)
        return clock.now()

    assert run(work()) == 0.0


def test_a_lockstep_clock_can_be_read_before_during_and_after_and_from_a_thread() -> None:
    clock = LockstepClock(start_s=5.0)
    assert clock.now() == 5.0
    run(clock.sleep(0.0))

    async def read() -> list[float]:
        await clock.sleep(2.0)
        seen: list[float] = []
        thread = threading.Thread(target=lambda: seen.append(clock.now()))
        thread.start()
        thread.join()
        return seen

    clock = LockstepClock(start_s=5.0)
    assert run(read()) == [pytest.approx(7.0)]
    assert clock.now() == pytest.approx(7.0)


def test_wall_time_runs_as_many_times_faster_as_asked() -> None:
    async def slept() -> tuple[float, float]:
        wall = time.monotonic()
        clock = WallClock(speed=50.0, start_s=100.0)
        before = clock.now()
        await clock.sleep(5.0)
        mission = clock.now() - before
        passed = time.monotonic() - wall
        assert before >= 100.0
        clock.close()
        return mission, passed

    mission, passed = asyncio.run(slept())
    assert 5.0 <= mission <= 50.0 * passed


def test_wall_work_runs_beside_the_loop_in_one_thread() -> None:
    async def work() -> set[str]:
        clock = WallClock()
        names = {await clock.work(lambda: threading.current_thread().name) for _ in range(5)}
        clock.close()
        return names

    names = asyncio.run(work())
    assert len(names) == 1 and names != {threading.main_thread().name}
