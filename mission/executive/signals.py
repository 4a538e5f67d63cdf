"""Ctrl-C and SIGTERM: they interrupt the mission, which then ends as its abort path says."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mission.executive.executive import Executive

SIGNALS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def interrupting(executive: Executive) -> Iterator[None]:
    """While inside, the signals raise `interrupted` instead of ending the program. Call it within the event loop."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    loop = asyncio.get_running_loop()
    before = {number: signal.getsignal(number) for number in SIGNALS}
    for number in SIGNALS:
        signal.signal(
            number,
            lambda received, frame: loop.call_soon_threadsafe(executive.interrupt, signal.Signals(received).name),
        )
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
