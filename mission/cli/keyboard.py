"""The operator's keyboard: a question on a line of its own, and single keys while a panel is shown."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any


def prompt(question: str) -> bool:
    """Ask on a line of its own. Ctrl-C ends the program, whoever handles it otherwise: nothing has taken off yet."""
    ours = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, signal.default_int_handler) if ours else None
    try:
        return input(f"{question} [y/N] ").strip().lower() in ("y", "yes")
    except EOFError:
        return False
    finally:
        if before is not None:
            signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def keys_pressed() -> Iterator[Callable[[float], str]]:
    """A function that waits so long for keys and returns those pressed. The terminal is as before afterwards."""
    import termios
    import tty

    try:
        before: list[Any] | None = termios.tcgetattr(sys.stdin)
        tty.setcbreak(sys.stdin)
    except (termios.error, ValueError, OSError):
        before = None

    def pressed(timeout_s: float) -> str:
        if before is None:
            time.sleep(timeout_s)
            return ""
        ready, _, _ = select.select([sys.stdin], [], [], timeout_s)
        if not ready:
            return ""
        keys = os.read(sys.stdin.fileno(), 32)
        if not keys:  # the terminal went away: there is nobody to press anything
            time.sleep(timeout_s)
        return keys.decode(errors="ignore")

    try:
        yield pressed
    finally:
        if before is not None:
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
