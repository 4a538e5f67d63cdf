"""Asking an operator before a transition is taken, and keeping the question until it is answered."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass

from mission.executive.queue import Queued


@dataclass(frozen=True)
class Question:
    """What an operator is asked before a transition. `text` is one line."""

    event: str
    source: str
    target: str

    @property
    def text(self) -> str:
        """The question as it is shown."""
        return f"{self.source}: {self.event} → {self.target}?"


Ask = Callable[[Question], Awaitable[bool]]


def asking(confirm: Callable[[str], bool], *, at_once: bool = False) -> Ask:
    """Ask with a function that waits for a person. It waits in a thread of its own, which nobody waits for: a question
    that is never answered must not keep a flight from ending. `at_once` (lockstep time): the world waits too."""

    async def ask(question: Question) -> bool:
        if at_once:
            return confirm(question.text)
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[bool] = loop.create_future()

        def tell(yes: bool) -> None:
            if not answer.done():
                answer.set_result(yes)

        def wait() -> None:
            try:
                yes = confirm(question.text)
            except Exception:  # the terminal went away
                yes = False
            with suppress(RuntimeError):  # the flight is over
                loop.call_soon_threadsafe(tell, yes)

        threading.Thread(target=wait, name="question", daemon=True).start()
        return await answer

    return ask


class Questions:
    """At most one question waits. `answered(yes)` is told what the asked operator says, unless the question is past."""

    def __init__(self, ask: Ask | None, answered: Callable[[bool], None]) -> None:
        self._ask, self._answered = ask, answered
        self._tasks: set[asyncio.Task[None]] = set()
        self._waiting: tuple[Queued, Question] | None = None
        self._refused: tuple[Queued, Question] | None = None

    @property
    def waiting(self) -> Question | None:
        """The question that has no answer yet."""
        return None if self._waiting is None else self._waiting[1]

    def put(self, queued: Queued, question: Question) -> None:
        """Ask whether an event may be followed. A question that still waits is past."""
        waiting = self._waiting = (queued, question)
        self._refused = None
        if self._ask is None:
            return
        ask = self._ask

        async def wait_for_answer() -> None:
            yes = await ask(question)
            if self._waiting is waiting:
                self._answered(yes)

        task = asyncio.get_running_loop().create_task(wait_for_answer(), name="question")
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    @property
    def open(self) -> Question | None:
        """The question that waits, or else the one that was answered with no: that may still become a yes."""
        asked = self._waiting or self._refused
        return None if asked is None else asked[1]

    def answer(self, yes: bool) -> Queued | None:
        """The event that the open question is about; from now on it waits no more."""
        asked = self._waiting or self._refused
        self._waiting, self._refused = None, None if yes else asked
        return None if asked is None else asked[0]

    def forget(self) -> None:
        """What was asked is past."""
        self._waiting = self._refused = None

    def close(self) -> None:
        """Nobody needs to answer any more."""
        self.forget()
        for task in self._tasks:
            task.cancel()
