"""The running behaviour: started as a task of its own, ended by an outcome, an error, cancellation, or abandonment."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Generator
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, cast

from mission.behaviours.behaviour import Behaviour
from mission.executive.gate import Gate

if TYPE_CHECKING:
    from mission.behaviours.behaviour import Parameters
    from mission.executive.services import Services

CANCEL_S = 0.5  # of the event loop: how long a behaviour may take to stop before it is abandoned
_SLICE_S = 0.05
_PASSES = 3  # of the event loop: most behaviours end within these, and no timer is needed
_REST_S = 0.5


class Leash:
    """Drives a coroutine as `await` does, until it is cut: then it is not resumed any more, whatever it wants."""

    _unwilling: ClassVar[list[Any]] = []  # those that would not even close: kept, so that nobody tries again

    def __init__(self, run: Callable[[], Awaitable[str]]) -> None:
        self.cut = False
        self._awaited = run

    def __await__(self) -> Generator[Any, Any, str]:
        inner: Any = self._awaited().__await__()
        thrown: list[BaseException] = []  # not a name of its own: an error that this frame kept would never be freed
        while True:
            try:
                waited_for = inner.throw(thrown.pop()) if thrown else next(inner)
            except StopIteration as stop:
                return cast(str, stop.value)
            try:
                yield waited_for
            except BaseException as error:
                if self.cut:
                    try:
                        inner.close()
                    except RuntimeError:
                        self._unwilling.append(inner)
                    raise
                thrown.append(error)


class Work:
    """Runs one behaviour at a time. `activation` counts them; `ended(activation, event, data)` hears how each ended."""

    def __init__(self, services: Services, gate: Gate, ended: Callable[[int, str, dict[str, Any]], None]) -> None:
        self._services, self._gate, self._ended = services, gate, ended
        self._task: asyncio.Task[None] | None = None
        self._stopping = False
        self._leash: Leash | None = None
        self._failed_s = float("-inf")
        self.activation = 0
        self.behaviour: Behaviour | None = None

    @property
    def running(self) -> bool:
        """Whether a behaviour is at work."""
        return self._task is not None and not self._task.done()

    def start(self, behaviour: Behaviour, parameters: Parameters | None) -> None:
        """Begin a behaviour; the one before must have been stopped."""
        assert not self.running
        self.activation += 1
        self._stopping = False
        self.behaviour = behaviour
        given = behaviour.parameters() if parameters is None else parameters
        self._leash = Leash(partial(behaviour.run, self._services, given))
        self._task = asyncio.get_running_loop().create_task(
            self._run(self.activation, behaviour, self._leash), name=f"behaviour {behaviour.name}"
        )

    async def stop(self, meanwhile: Callable[[], None]) -> bool:
        """Cancel the behaviour and wait for it. One that will not end is cut off from the vehicle and left behind.

        `meanwhile` is called again and again while it takes its time. Returns whether it ended in time. Whatever it
        still reports belongs to an activation that is over.
        """
        task, self._task, behaviour = self._task, None, self.behaviour
        self._stopping, self.behaviour = True, None
        ended = self.activation
        self.activation += 1
        if task is None or task.done():
            return True
        task.cancel()
        for _ in range(_PASSES):
            await asyncio.sleep(0)
            if task.done():
                return True
        loop = asyncio.get_running_loop()
        until = loop.time() + CANCEL_S
        while not task.done() and loop.time() < until:
            meanwhile()
            await asyncio.wait([task], timeout=_SLICE_S)
        if task.done():
            return True
        self._gate.revoke(ended)
        assert self._leash is not None
        self._leash.cut = True
        task.cancel()
        self._services.log.error(
            "behaviour ignores cancellation and is abandoned", behaviour=behaviour and behaviour.name
        )
        return False

    async def _run(self, activation: int, behaviour: Behaviour, leash: Leash) -> None:
        self._gate.enter(activation)
        log = self._services.log
        try:
            outcome = await leash
        except asyncio.CancelledError as cancelled:
            if not self._stopping and activation == self.activation:
                self._fail(activation, behaviour, str(cancelled) or "was cancelled from within")
            raise
        except (Exception, SystemExit) as error:
            log.exception("behaviour failed", behaviour=behaviour.name)
            await self._rest()
            self._fail(activation, behaviour, f"{type(error).__name__}: {error}" if str(error) else repr(error))
        else:
            if outcome in behaviour.outcomes:
                self._ended(activation, outcome, {"behaviour": behaviour.name})
            else:
                self._fail(activation, behaviour, f"returned {outcome!r}, which it does not declare")

    async def _rest(self) -> None:
        """A behaviour that fails as soon as it starts, again and again, must not spin."""
        now = asyncio.get_running_loop().time()
        failed_s, self._failed_s = self._failed_s, now
        if now - failed_s < _REST_S:
            await asyncio.sleep(_REST_S)

    def _fail(self, activation: int, behaviour: Behaviour, text: str) -> None:
        self._ended(activation, "behaviour_failed", {"behaviour": behaviour.name, "error": text.splitlines()[0][:300]})
