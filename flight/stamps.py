"""From the vehicle's time since boot to the executive's clock."""

from __future__ import annotations

from collections import deque

_BACKWARD_S = 1.0  # a vehicle whose clock goes back by more than this has started anew


class StampMap:
    """The offset between two clocks from the messages that came fastest.

    A message is never received before it was stamped, so the least difference of arrival and stamp in a short window
    is the offset plus the least delay. The window is short (wall seconds) since a simulated vehicle that lost
    processor time falls behind the executive's clock for good, and stamps must follow at once."""

    def __init__(self, window_s: float = 0.5) -> None:
        self._window_s = window_s
        self._least: deque[tuple[float, float]] = deque()
        self._last_boot_s = -1.0

    def map(self, boot_s: float, arrival_s: float, wall_s: float) -> tuple[float, bool]:
        """The stamp on the executive's clock of a message stamped `boot_s`, and whether the vehicle's clock began anew.

        arrival_s: when it came, on the executive's clock; wall_s: the same on a wall clock.
        """
        restarted = boot_s < self._last_boot_s - _BACKWARD_S
        if restarted:
            self._least.clear()
        self._last_boot_s = boot_s
        difference = arrival_s - boot_s
        while self._least and self._least[-1][1] >= difference:
            self._least.pop()
        self._least.append((wall_s, difference))
        while self._least[0][0] < wall_s - self._window_s:
            self._least.popleft()
        return boot_s + self._least[0][1], restarted

    def boot_of(self, stamp_s: float) -> float:
        """The vehicle's time since boot at a time on the executive's clock; 0 before anything was heard."""
        return stamp_s - self._least[0][1] if self._least else 0.0
