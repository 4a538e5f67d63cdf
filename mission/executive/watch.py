"""Evaluates every monitor ten times a mission second and raises what they say."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from mission.executive.monitors.monitor import Watch, look, monitors
from mission.executive.monitors.pilot import STICKS

if TYPE_CHECKING:
    from mission.executive.clock import Clock
    from mission.executive.services import RaiseEvent
    from mission.executive.snapshot import Snapshot

PERIOD_S = 0.1


class Watcher:
    """Remembers what each monitor has raised. `snapshot(was_ours)` delivers the present instant."""

    def __init__(
        self, snapshot: Callable[[bool], Snapshot], raise_event: RaiseEvent, log: Any, *, airborne: bool = False
    ) -> None:
        self._snapshot, self._raise, self._log = snapshot, raise_event, log
        self._watches = dict.fromkeys(monitors(), Watch())
        self._was_ours = airborne
        self._broken: set[str] = set()

    def look(self) -> None:
        """One round of all monitors. One that fails raises `abort`: flying on blind is not an option."""
        try:
            snapshot = self._snapshot(self._was_ours)
        except Exception as error:
            self._fails("snapshot", error)
            return
        telemetry = snapshot.telemetry
        self._was_ours = telemetry.in_air and (self._was_ours or telemetry.flight_mode not in STICKS)
        for name, monitor in monitors().items():
            try:
                self._watches[name], raised = look(monitor, self._watches[name], snapshot)
            except Exception as error:
                self._fails(name, error)
                continue
            if raised is not None:
                self._raise(raised, **({"excess": round(self._watches[name].worst, 3)} if raised == name else {}))

    def rearm(self, name: str) -> None:
        """Let the event be raised again if its limit is still exceeded: the last time nobody answered it."""
        if name in self._watches:
            self._watches[name] = Watch()

    def _fails(self, name: str, error: Exception) -> None:
        """Said once; what fails goes on failing."""
        if name not in self._broken:
            self._broken.add(name)
            self._log.exception("monitor failed", monitor=name)
            self._raise("abort", monitor=name, error=f"{type(error).__name__}: {error}")

    async def run(self, clock: Clock) -> None:
        """Until cancelled."""
        while True:
            self.look()
            await clock.sleep(PERIOD_S)
