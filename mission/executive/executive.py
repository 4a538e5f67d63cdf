"""The executive: flies a mission to its end, and is what everybody else may call: run, raise, ask, command, look."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from mission.behaviours.behaviour import behaviours
from mission.executive.conductor import Conductor
from mission.executive.events import event
from mission.executive.helm import PULSE_S
from mission.executive.journal import SLOWEST_DISK_S
from mission.executive.machine import entries
from mission.executive.resume import take_up
from mission.executive.status import Status, possible

KEEP_S = 0.5  # how often the journal is told what a behaviour has found out
_MOST_FAULTS = 3


@dataclass(frozen=True)
class Outcome:
    """How a run ended: the outcome and path of its final state, and whether it was told to stop."""

    outcome: str
    final_state: str
    interrupted: bool = False


class Executive(Conductor):
    """Flies a mission. `run` returns when the machine is in a final state; no behaviour can end it earlier.

    Built as a Conductor is.
    """

    interrupted = False
    _loop: asyncio.AbstractEventLoop | None = None
    _faults = 0
    _kept_s = 0.0

    async def run(self) -> Outcome:
        """Fly until a final state is reached."""
        self._loop = asyncio.get_running_loop()
        self._chronicle.journal.on_lost = self._journal_lost
        watching = self._loop.create_task(self._watcher.run(self._clock), name="monitors")
        watching.add_done_callback(self._monitors_ended)
        configuration = self._machine.configuration
        try:
            self._chronicle.begins(configuration, autonomy=self.autonomy, resumed=self._resumed)
            entered = tuple(reversed(configuration.active))
            self._timing = self._timing.entering(self.mission, entered, self._clock.now())
            try:
                if self._resumed:
                    await self._helm.patiently(take_up(self.services, self.mission, configuration))
                await self._begin()
            except Exception as error:
                await self._fault(error)
            while self._ended is None:
                await self._turn()
            await self._work.stop(self._helm.beat)
            await self._helm.leave()
            self._chronicle.ends(self._ended, self.state, self._why)
            await self._helm.patiently(self._chronicle.journal.durable(), SLOWEST_DISK_S)
            return Outcome(self._ended, self.state, self.interrupted)
        finally:
            self._questions.close()
            watching.cancel()
            await asyncio.gather(watching, return_exceptions=True)

    async def _turn(self) -> None:
        """Handle one event, or wait for one until something is due."""
        self._helm.beat()
        lost = self._silence.lost(asyncio.get_running_loop().time(), self._autopilot.telemetry.link_age_s)
        if lost is not None:
            self._give_up(lost)
            return
        try:
            await self._act_on_time()
            queued = self._queue.pop()
            if queued is not None:
                await self._handle(queued)
                return
        except Exception as error:
            await self._fault(error)
        due_s, patience = self._timing.next_s(), PULSE_S
        if due_s is not None:
            patience = min(patience, max((due_s - self._clock.now()) / self._clock.speed, 0.0))
        with suppress(TimeoutError):
            async with asyncio.timeout(patience):
                await self._queue.arrived.wait()

    def _give_up(self, why: str) -> None:
        """End where no transition can: nothing more is waited for."""
        if self._ended is None:
            self.services.log.error("run given up", why=why, state=self.state)
            self._ended, self._why = "aborted", why

    async def _act_on_time(self) -> None:
        """Deadlines cancel the work that they time; transitions whose delay is over are taken if they still can be."""
        now = self._clock.now()
        if now - self._kept_s >= KEEP_S and not len(self._queue):
            self._kept_s = now
            self._chronicle.found_out(self.state)
        late = self._timing.overdue(now)
        if late is not None:
            self._timing = self._timing.expired(late)
            if self._questions.waiting is None:
                self._queue.put("timed_out", {"state": late}, origin=late)
                await self._stop()
                self._helm.hold()
        ripe = self._timing.due(now)
        if ripe is not None:
            self._timing = self._timing.without(ripe)
            self._queue.put(ripe.event, {}, only=ripe.transition)

    async def _fault(self, error: Exception) -> None:
        """An error of the executive itself: abort, and if that does not help either, leave the vehicle holding."""
        self._faults += 1
        self.services.log.exception("executive failed", state=self.state)
        self._chronicle.fails(error)
        if self._faults >= _MOST_FAULTS:
            await self._stop()
            self._ended = "aborted"
        else:
            self._queue.put("abort", {"error": type(error).__name__})

    def raise_event_threadsafe(self, name: str, **data: Any) -> None:
        """The same from any thread."""
        event(name)
        if self._loop is not None:
            with suppress(RuntimeError):  # the loop has ended: there is nothing left to tell it
                self._loop.call_soon_threadsafe(lambda: self.raise_event(name, **data))

    def interrupt(self, by: str = "") -> None:
        """Ctrl-C, SIGTERM: run the abort path, and say so in the outcome."""
        self.interrupted = True
        self._queue.put("interrupted", {"by": by} if by else {})

    def end_now(self, by: str = "") -> None:
        """Told to stop once more while interrupted: end without waiting for the abort path."""
        self.interrupted = True
        self.note("end_now", by)
        self._give_up("told to stop a second time")

    def skip(self, path: str) -> tuple[bool, str]:
        """Go to a state that the mission marks as an entry; returns whether, and the words for the operator."""
        known = entries(self.mission)
        if path not in known:
            return False, f"{path} is not an entry of this mission; entries: {', '.join(known) or 'none'}"
        leaf = self.mission.states[self.mission.leaf(path)]
        flies = behaviours()[leaf.do].airborne if leaf.do else None
        if flies is not None and flies != self._autopilot.telemetry.in_air:
            return False, f"{path} is for a vehicle {'in the air' if flies else 'on the ground'}"
        self._queue.put("skip", {"to": path}, only=known[path], confirmed=True)
        return True, f"going to {path}"

    def answers(self, name: str) -> bool:
        """Whether the event would lead anywhere now."""
        return self._machine.choose(name, self._quantities()) is not None

    def status(self) -> Status:
        """One glance at the run."""
        now, configuration = self._clock.now(), self._machine.configuration
        deadlines = [due for path, due in self._timing.deadlines.items() if path in configuration.active]
        question, behaviour, progress = self._questions.waiting, self._work.behaviour, self.services.progress
        return Status(
            mission=self.mission.name,
            path=configuration.leaf,
            now_s=now,
            entered_s=self._timing.entered_s.get(configuration.leaf, now),
            deadline_s=min(deadlines, default=None),
            behaviour=None if behaviour is None else behaviour.name,
            next=possible(self.mission, configuration, self._timing, self._quantities()),
            recent=tuple(self._recent),
            autonomy=self.autonomy,
            paused=self._paused,
            waiting=None if question is None else question.text,
            let_go=self._gate.let_go,
            interrupted=self.interrupted,
            journal_error=self._chronicle.journal.error,
            ended=self._ended,
            text=progress.text,
            station_m=progress.station_m,
        )

    def _monitors_ended(self, task: asyncio.Task[None]) -> None:
        """Nobody watches the limits any more."""
        if not task.cancelled():
            self.services.log.error("monitors ended", exc_info=task.exception())
            self.raise_event("abort", error="the monitors ended")

    def _journal_lost(self, text: str) -> None:
        self.services.log.error("journal lost", text=text)
        self.raise_event_threadsafe("journal_lost", error=text)
