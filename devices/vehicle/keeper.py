"""Whose the vehicle is: of the program that started it or took it up again; and how long it waits for another."""

from __future__ import annotations

import os
import select
from contextlib import suppress

LANDED_S = 20.0  # wall; a vehicle on the ground is soon replaced by another on the ground
CHECK_S = 0.5


class Guardian:
    """A process, watched: `alive` turns False when it ends, also where its number is given to another."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._fd: int | None = None
        self._gone = False
        with suppress(AttributeError):  # no such call on this system: its number alone has to do
            try:
                self._fd = os.pidfd_open(pid)
            except OSError:
                self._gone = not _exists(pid)

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        if not self._gone:
            if self._fd is not None:
                self._gone = bool(select.select([self._fd], [], [], 0)[0])
            else:
                self._gone = not _exists(self.pid)
        return not self._gone

    def close(self) -> None:
        """Watch no more; idempotent."""
        fd, self._fd = self._fd, None
        if fd is not None:
            os.close(fd)


class Keeper:
    """Says when a vehicle without a program has waited long enough: `orphan_s` wall seconds while it is armed.

    pid: of the program, None for a vehicle that nobody keeps and that waits for ever.
    """

    def __init__(self, pid: int | None, orphan_s: float) -> None:
        self._guardian = None if pid is None else Guardian(pid)
        self._orphan_s = orphan_s
        self._checked_s = self._armed_s = float("-inf")
        self._orphaned_s: float | None = None

    @property
    def kept(self) -> bool:
        """Whether its program still runs."""
        return self._guardian is not None and self._guardian.alive

    def hand_over(self, pid: int) -> None:
        """Another program has it from now on."""
        if self._guardian is not None:
            self._guardian.close()
        self._guardian, self._orphaned_s = Guardian(pid), None

    def look(self, now_s: float, armed: bool) -> tuple[bool, str | None]:
        """Whether its program was just found to be gone, and why it is time to end, if it is. Wall seconds."""
        if self._guardian is None or now_s - self._checked_s < CHECK_S:
            return False, None
        self._checked_s = now_s
        if armed:
            self._armed_s = now_s
        died = self._orphaned_s is None and not self._guardian.alive
        if died:
            self._orphaned_s = now_s
        if self._orphaned_s is None:
            return False, None
        alone_s = now_s - self._orphaned_s
        if not armed and now_s - max(self._armed_s, self._orphaned_s) > min(LANDED_S, self._orphan_s):
            return died, "landed without a parent"
        if alone_s > self._orphan_s:
            return died, "without a parent for too long"
        return died, None


def _exists(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
