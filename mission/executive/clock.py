"""Time, in one place: wall time, scaled for simulation, and lockstep time, in which sleeping moves the world."""

from __future__ import annotations

import asyncio
import selectors
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any, Protocol, TypeVar

T = TypeVar("T")
LONGEST_SLEEP_S = 0.5  # wall seconds, after which a sleeper looks whether the speed has changed


class Clock(Protocol):
    """All waiting goes through here. Seconds are mission seconds, from zero at the start of the run."""

    speed: float

    def now(self) -> float:
        """Mission seconds since the start."""
        ...

    async def sleep(self, seconds: float) -> None:
        """Wait for so many mission seconds."""
        ...

    async def work(self, function: Callable[..., T], *arguments: Any) -> T:
        """Run a blocking function beside the event loop (wall time), or at once (lockstep time); return its result."""
        ...

    def close(self) -> None:
        """Stop the worker thread."""
        ...


class WallClock:
    """Wall time, `speed` times faster: 1 for a real flight. The speed may change on the way; time never jumps."""

    def __init__(self, speed: float = 1.0, start_s: float = 0.0) -> None:
        self.speed = speed
        self._start_s = start_s
        self._origin = time.monotonic()
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="vision")

    def now(self) -> float:
        return self._start_s + (time.monotonic() - self._origin) * self.speed

    def change_speed(self, speed: float) -> None:
        """Go on from now at another speed."""
        wall = time.monotonic()
        self._start_s += (wall - self._origin) * self.speed
        self._origin, self.speed = wall, speed

    async def sleep(self, seconds: float) -> None:
        due = self.now() + max(seconds, 0.0)
        while True:
            await asyncio.sleep(min(max(due - self.now(), 0.0) / self.speed, LONGEST_SLEEP_S))
            if self.now() >= due - 1e-6:
                return

    async def work(self, function: Callable[..., T], *arguments: Any) -> T:
        return await asyncio.get_running_loop().run_in_executor(self._worker, function, *arguments)

    def close(self) -> None:
        self._worker.shutdown(wait=False, cancel_futures=True)


class LockstepLoop(asyncio.SelectorEventLoop):
    """An event loop whose time is the simulated world's: when every task waits, the world moves to the next deadline.

    `advance(seconds)` moves the world; it is called with the time to the next timer. Anything that reads sockets or
    threads would make a run depend on the machine, so nothing here waits for them: a loop with no timer and nothing
    ready is stuck and raises RuntimeError rather than hang.
    """

    def __init__(self, advance: Callable[[float], None] = lambda seconds: None) -> None:
        self._simulated_s = 0.0
        self.advance = advance
        super().__init__(_LockstepSelector(self))
        self._clock_resolution = 1e-9

    def time(self) -> float:
        return self._simulated_s

    def pass_time(self, seconds: float) -> None:
        """Advance the world, then the clock."""
        self.advance(seconds)
        self._simulated_s += seconds


class _LockstepSelector(selectors.DefaultSelector):
    """Instead of sleeping until the next timer, advances the loop's time to it."""

    def __init__(self, loop: LockstepLoop) -> None:
        super().__init__()
        self._loop = loop

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0)
        if ready or timeout == 0:
            return ready
        if timeout is None:
            raise RuntimeError("lockstep time: every task waits and none has a deadline")
        self._loop.pass_time(timeout)
        return ready


class LockstepClock:
    """Mission time of a LockstepLoop: deterministic, as fast as the machine allows.

    It belongs to the loop that first asks it; others, such as a view in its own thread, may read it at any time.
    """

    speed = 1.0

    def __init__(self, start_s: float = 0.0) -> None:
        self._start_s = start_s
        self._loop: asyncio.AbstractEventLoop | None = None

    def now(self) -> float:
        loop = self._bound()
        return self._start_s + (0.0 if loop is None else loop.time())

    async def sleep(self, seconds: float) -> None:
        self._bound()
        await asyncio.sleep(max(seconds, 0.0))

    async def work(self, function: Callable[..., T], *arguments: Any) -> T:
        await asyncio.sleep(0)
        return function(*arguments)

    def _bound(self) -> asyncio.AbstractEventLoop | None:
        if self._loop is None:
            with suppress(RuntimeError):
                self._loop = asyncio.get_running_loop()
        return self._loop

    def close(self) -> None:
        """Nothing to stop."""
