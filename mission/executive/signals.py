"""Ctrl-C and SIGTERM: they interrupt the mission, which then ends as its abort path says; a second one ends it now."""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mission.executive.executive import Executive

SIGNALS = (signal.SIGINT, signal.SIGTERM)
TWICE_S = 0.3  # some tools signal a process and its group: sooner than this, it is the same word


@contextmanager
def interrupting(executive: Executive) -> Iterator[None]:
    """While inside, the first signal raises `interrupted` instead of ending the program, and one that follows ends the
    run in an orderly way without waiting for the abort path. Call it within the event loop."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    loop = asyncio.get_running_loop()
    before = {number: signal.getsignal(number) for number in SIGNALS}
    first_s: float | None = None

    def told(name: str) -> None:
        nonlocal first_s
        now = time.monotonic()
        if first_s is None:
            first_s = now
            executive.interrupt(name)
        elif now - first_s > TWICE_S:
            executive.end_now(name)

    for number in SIGNALS:
        signal.signal(number, lambda received, frame: loop.call_soon_threadsafe(told, signal.Signals(received).name))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
