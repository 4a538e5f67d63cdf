"""Whose vehicle it is: the last mode that this program commanded, and what the autopilot makes of it by itself."""

from __future__ import annotations

from collections.abc import Mapping

SUCCESSORS: Mapping[str, frozenset[str]] = {
    "TAKEOFF": frozenset(("TAKEOFF", "HOLD", "LOITER")),  # at the height it holds
    "LAND": frozenset(("LAND",)),  # on the ground it disarms
    "HOLD": frozenset(("HOLD", "LOITER")),
    "OFFBOARD": frozenset(("OFFBOARD",)),
}
"""A commanded mode and those into which the autopilot goes on from it without being told, by PX4's names."""

STREAM_LOST = frozenset(("HOLD", "LOITER", "LAND"))
"""Where the autopilot waits when our stream broke off; it comes back to OFFBOARD with the first setpoint."""

UNSAID = frozenset(("UNKNOWN", ""))

MODE_OF: Mapping[str, str] = {
    "take_off": "TAKEOFF",
    "land": "LAND",
    "hold": "HOLD",
    "start_offboard": "OFFBOARD",
    "start": "OFFBOARD",
}
"""Commands that a behaviour may give, with the mode that each asks for."""


class Commanded:
    """Remembers what was asked of the vehicle. resumed: it was this mission's before this program was started.

    A mode that has been asked for replaces the one before it only once it was reported: a command may be refused, or
    get lost.
    """

    def __init__(self) -> None:
        self.resumed = False
        self.armed = False
        self.mode: str | None = None
        self.obeyed = False
        self._earlier: frozenset[str] | None = None

    @property
    def took_over(self) -> bool:
        """Whether the vehicle is this mission's to command: armed or flown by it, now or before it was cut off."""
        return self.resumed or self.armed or self.mode is not None

    def asks(self, command: str) -> None:
        """A command is given; those that change no mode only say that the vehicle is ours."""
        mode = MODE_OF.get(command)
        if command == "arm":
            self.armed = True
        if mode is None or mode == self.mode:
            return
        self._earlier = self._allowed(False)
        self.mode, self.obeyed = mode, False

    def reported(self, mode: str) -> None:
        """The autopilot says what it flies."""
        self.obeyed = self.obeyed or mode == self.mode

    def modes(self, *, streaming: bool) -> frozenset[str] | None:
        """The modes that follow from our commands; None where every mode may be, nothing having been commanded."""
        if self.mode is None:
            return SUCCESSORS["OFFBOARD"] if streaming else None
        return self._allowed(streaming)

    def covers(self, mode: str, *, streaming: bool) -> bool:
        """Whether this mode may be our own doing; else somebody else flies."""
        modes = self.modes(streaming=streaming)
        return modes is None or mode in modes or mode in UNSAID

    def _allowed(self, streaming: bool) -> frozenset[str] | None:
        if self.mode is None:
            return None
        found = SUCCESSORS[self.mode]
        if self.mode == "OFFBOARD" and not streaming:
            found |= STREAM_LOST
        if self.obeyed:
            return found
        return None if self._earlier is None else found | self._earlier
