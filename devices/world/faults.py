"""When each fault of the simulated world is on."""

from __future__ import annotations

import threading

from devices.world.settings import Faults, Window


class FaultSchedule:
    """Answers `active(name, now_s)`. Times are mission seconds; `enter_state` arms the faults that wait for a state.

    Several threads may ask at once.
    """

    def __init__(self, faults: Faults) -> None:
        self.faults = faults
        self._entered: dict[str, float] = {}
        self._lock = threading.Lock()

    def enter_state(self, path: str, now_s: float) -> None:
        """A state, by its dotted path, was entered. Only the first entry of a state and of those around it counts."""
        parts = path.split(".")
        with self._lock:
            for depth in range(1, len(parts) + 1):
                self._entered.setdefault(".".join(parts[:depth]), now_s)

    def active(self, name: str, now_s: float) -> bool:
        """Whether the fault called `name` (a field of `Faults`) is on at `now_s`."""
        window: Window | None = getattr(self.faults, name)
        if window is None:
            return False
        start = self._start_s(window)
        if start is None or now_s < start:
            return False
        since = now_s - start
        if window.every_s is not None and window.for_s is not None:
            return since % window.every_s >= window.every_s - window.for_s
        return window.for_s is None or since < window.for_s

    def _start_s(self, window: Window) -> float | None:
        """Mission time at which it begins, None while the state it waits for was not entered."""
        if window.state is None:
            return (window.at_s or 0.0) + window.after_s
        with self._lock:
            entered = self._entered.get(window.state)
        return None if entered is None else entered + window.after_s
