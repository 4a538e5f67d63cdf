"""A vehicle that is never heard again: after how long the run ends instead of waiting for it."""

from __future__ import annotations

from collections.abc import Callable

LOST_S = 60.0  # wall seconds; the autopilot itself goes home or lands long before, PX4's default is half a second
GONE_S = 10.0  # the same where the vehicle is known not to exist any more
_STEP_S = 1.0


class Silence:
    """Adds up how long nothing was heard. gone: whether the vehicle is known not to exist any more."""

    def __init__(self, gone: Callable[[], bool] = lambda: False) -> None:
        self._gone = gone
        self._silent_s = 0.0
        self._looked_s: float | None = None

    def lost(self, now_s: float, link_age_s: float) -> str | None:
        """Why the run must end, in words, or None. now_s: of the event loop. Call it often.

        A loop that was blocked has not listened either: more than a second between two looks counts as one.
        """
        elapsed = 0.0 if self._looked_s is None else min(now_s - self._looked_s, _STEP_S)
        self._looked_s = now_s
        self._silent_s = min(self._silent_s + elapsed, link_age_s)
        if self._silent_s >= LOST_S:
            return f"vehicle lost: nothing was heard from the autopilot for {LOST_S:.0f} s"
        if self._silent_s >= GONE_S and self._gone():
            return "vehicle lost: the simulated vehicle's process has ended"
        return None
