"""The executive: one task that owns the machine and carries every event to its end before it looks at the next.

Stop the old behaviour, write the transition to the journal, move the machine, start the new behaviour: in this order.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from flight.autopilot import Setpoint
from mission.behaviours.behaviour import behaviours
from mission.executive import snapshot as snapshots
from mission.executive.decision import Autonomy, autonomy_after, decide
from mission.executive.events import EVENTS, event
from mission.executive.gate import Gate, guard_services
from mission.executive.journal import FORMAT, Journal
from mission.executive.machine import Machine, entries
from mission.executive.queue import EventQueue, Queued
from mission.executive.resume import take_up
from mission.executive.snapshot import Snapshot
from mission.executive.status import Recent, Status, possible
from mission.executive.timing import Timing, Waiting
from mission.executive.watch import Watcher
from mission.executive.work import Work
from mission.language import semantics
from mission.language.document import Mission, Transition
from mission.language.semantics import Configuration

if TYPE_CHECKING:
    from mission.executive.clock import Clock
    from mission.executive.services import Services

PULSE_S = 0.1  # of the event loop: the executive shows at least this often that it is alive
STALLED_S = 0.8  # of the event loop: after such a gap the autopilot may have left OFFBOARD
KEEP_S = 2.0  # how often the journal is told what a behaviour has found out and how far it has come
_MOST_FAULTS = 3


@dataclass(frozen=True)
class Outcome:
    """How a run ended: the outcome and path of its final state, and whether it was told to stop."""

    outcome: str
    final_state: str
    interrupted: bool = False


@dataclass(frozen=True)
class Question:
    """What an operator is asked before a transition. `text` is one line."""

    event: str
    source: str
    target: str

    @property
    def text(self) -> str:
        """The question as it is shown."""
        return f"{self.source}: {self.event} → {self.target}?"


Ask = Callable[[Question], Awaitable[bool]]


class Executive:
    """Flies a mission. `run` returns when the machine is in a final state; no behaviour can end it earlier.

    services: put behind a gate, in place, so that an abandoned behaviour cannot steer. ask: how an operator is asked;
    without it a transition that needs a yes waits for `confirm`. resume: where an interrupted run goes on.
    """

    def __init__(
        self,
        mission: Mission,
        services: Services,
        clock: Clock,
        journal: Journal,
        *,
        ask: Ask | None = None,
        autonomy: Autonomy = "full",
        resume: Configuration | None = None,
    ) -> None:
        self.mission, self.services, self.autonomy = mission, services, autonomy
        self.interrupted = False
        self._clock, self._journal, self._ask = clock, journal, ask
        self._resumed = resume is not None
        self._autopilot, self._setpoints, self._perception = services.autopilot, services.setpoints, services.perception
        self._gate = Gate()
        guard_services(services, self._gate)
        self._machine = Machine(mission, resume)
        self._queue = EventQueue()
        self._work = Work(services, self._gate, self._behaviour_ended)
        self._watcher = Watcher(self._snapshot, self.raise_event, services.log, airborne=self._resumed)
        self._timing = Timing()
        self._recent: deque[Recent] = deque(maxlen=8)
        self._pending: Queued | None = None
        self._ignored: set[str] = set()
        self._remembered: dict[str, Any] = {}
        self._station_m: float | None = None
        self._paused = False
        self._ended: str | None = None
        self._faults = 0
        self._alive_s = 0.0
        self._kept_s = 0.0
        self._loop: asyncio.AbstractEventLoop | None = None
        self._asking: set[asyncio.Task[None]] = set()
        journal.on_lost = self._journal_lost

    # What others call

    @property
    def state(self) -> str:
        """Path of the active leaf."""
        return self._machine.state

    async def run(self) -> Outcome:
        """Fly until a final state is reached."""
        self._loop = asyncio.get_running_loop()
        self._alive_s = self._loop.time()
        watching = self._loop.create_task(self._watcher.run(self._clock), name="monitors")
        try:
            self._journal.append(
                "start",
                self._clock.now(),
                mission=self.mission.name,
                version=self.mission.version,
                format=FORMAT,
                autonomy=self.autonomy,
                resumed=self._resumed,
                state=self._machine.state,
                history=self._machine.configuration.history,
                taken=self._machine.configuration.taken,
            )
            now = self._clock.now()
            self._timing = self._timing.entering(self.mission, tuple(reversed(self._machine.configuration.active)), now)
            try:
                if self._resumed:
                    await self._patiently(take_up(self.services, self.mission, self._machine.configuration))
                await self._begin()
            except Exception as error:
                await self._fault(error)
            while self._ended is None:
                await self._turn()
            await self._finish()
            return Outcome(self._ended, self._machine.state, self.interrupted)
        finally:
            watching.cancel()
            for task in self._asking:
                task.cancel()
            with suppress(asyncio.CancelledError):
                await watching

    def raise_event(self, name: str, **data: Any) -> None:
        """Queue an event of the table or an outcome. From the event loop's thread.

        Raises:
            EventError: nobody declared it.
        """
        entry = event(name)
        if entry.lets_go:
            self._let_go()
        if entry.raised_by == "operator" and "by" in data:
            self.note(name, str(data["by"]), **{key: value for key, value in data.items() if key != "by"})
        self._queue.put(name, data)

    def raise_event_threadsafe(self, name: str, **data: Any) -> None:
        """The same from any thread."""
        event(name)
        if self._loop is not None:
            self._loop.call_soon_threadsafe(lambda: self.raise_event(name, **data))

    def interrupt(self, by: str = "") -> None:
        """Ctrl-C, SIGTERM: run the abort path, and say so in the outcome."""
        self.interrupted = True
        self._queue.put("interrupted", {"by": by} if by else {})

    def confirm(self, yes: bool) -> str:
        """Answer the question that waits; returns what becomes of it, for the operator to read."""
        pending, self._pending = self._pending, None
        if pending is None:
            return "nothing waits for an answer"
        if not yes:
            return f"{pending.name} is not followed; the vehicle holds in {self._machine.state}"
        about = {"activation": pending.activation, "origin": pending.origin, "only": pending.only}
        self._queue.put(pending.name, pending.data, confirmed=True, **about)
        return f"{pending.name} is followed"

    def skip(self, path: str) -> str:
        """Go to a state that the mission marks as an entry; returns what becomes of it."""
        known = entries(self.mission)
        if path not in known:
            names = ", ".join(known) or "none"
            return f"{path} is not an entry of this mission; entries: {names}"
        leaf = self.mission.states[self.mission.leaf(path)]
        flies = behaviours()[leaf.do].airborne if leaf.do else None
        in_air = self._autopilot.telemetry.in_air
        if flies is not None and flies != in_air:
            return f"{path} is for a vehicle {'in the air' if flies else 'on the ground'}"
        self._queue.put("skip", {"to": path}, only=known[path], confirmed=True)
        return f"going to {path}"

    def answers(self, name: str) -> bool:
        """Whether the event would lead anywhere now."""
        return self._machine.choose(name, self._quantities()) is not None

    def status(self) -> Status:
        """One glance at the run."""
        now, active = self._clock.now(), self._machine.configuration.active
        deadlines = [self._timing.deadlines[path] for path in active if path in self._timing.deadlines]
        configuration, quantities = self._machine.configuration, self._quantities()
        return Status(
            mission=self.mission.name,
            path=self._machine.state,
            now_s=now,
            entered_s=self._timing.entered_s.get(self._machine.state, now),
            deadline_s=min(deadlines, default=None),
            behaviour=self._work.behaviour.name if self._work.behaviour else None,
            next=possible(self.mission, configuration, self._timing, quantities),
            recent=tuple(self._recent),
            autonomy=self.autonomy,
            paused=self._paused,
            waiting=None if self._pending is None else self._question(self._pending).text,
            let_go=self._gate.let_go,
            interrupted=self.interrupted,
            journal_error=self._journal.error,
            ended=self._ended,
            text=self.services.progress.text,
            station_m=self.services.progress.station_m,
        )

    def note(self, command: str, who: str, **about: Any) -> None:
        """Write an operator's act to the journal."""
        self._journal.append("operator", self._clock.now(), command=command, who=who, **about)

    # The loop

    async def _turn(self) -> None:
        """Handle one event, or wait for one until something is due."""
        self._alive()
        try:
            await self._act_on_time()
            queued = self._queue.pop()
            if queued is not None:
                await self._handle(queued)
                return
        except Exception as error:
            await self._fault(error)
        await self._wait()

    async def _wait(self) -> None:
        due_s = self._timing.next_s()
        patience = PULSE_S
        if due_s is not None:
            patience = min(patience, max((due_s - self._clock.now()) / self._clock.speed, 0.0))
        with suppress(TimeoutError):
            async with asyncio.timeout(patience):
                await self._queue.arrived.wait()

    async def _act_on_time(self) -> None:
        """Deadlines cancel the work that they time; transitions whose delay is over are taken if they still can be."""
        now = self._clock.now()
        if now - self._kept_s >= KEEP_S and not len(self._queue):
            self._kept_s = now
            self._journal_memory(now)
        late = self._timing.overdue(now)
        if late is not None:
            self._timing = self._timing.expired(late)
            if self._pending is None:
                self._queue.put("timed_out", {"state": late}, origin=late)
                await self._stop()
                self._hold()
        ripe = self._timing.due(now)
        if ripe is not None:
            self._timing = self._timing.without(ripe)
            self._queue.put(ripe.event, {}, only=ripe.transition)

    async def _handle(self, queued: Queued) -> None:
        if queued.activation is not None and queued.activation != self._work.activation:
            self._journal_event(queued, "stale", {})
            return
        if queued.name == "step" and self._pending is not None:
            self._journal_event(queued, "confirmation", {})
            self.confirm(True)
            return
        quantities = self._quantities()
        decision = decide(self.mission, self._machine.configuration, queued, quantities, self.autonomy)
        self._journal_event(queued, decision.led_to, quantities)
        transition = decision.transition
        if decision.led_to == "ignored":
            self._unanswered(queued)
        elif transition is None:
            return
        elif decision.led_to == "delayed":
            waiting = Waiting(self._clock.now() + decision.delay_s, queued.name, transition)
            self._timing = self._timing.delaying(waiting)
        elif decision.led_to == "asked":
            self._pending = replace(queued, only=transition)
            self._put_question(self._pending)
        else:
            await self._go(queued, transition, quantities)

    async def _go(self, queued: Queued, transition: Transition, quantities: semantics.Quantities) -> None:
        """One transition: stop, journal, move, start."""
        if event(transition.event).lets_go:
            self._let_go()
        await self._stop()
        step = semantics.take(self.mission, self._machine.configuration, transition, queued.name)
        now = self._clock.now()
        self._journal.append(
            "transition",
            now,
            event=queued.name,
            by=transition.event,
            key=transition.key,
            **{"from": step.source, "to": step.after.leaf},
            history=step.after.history,
            taken=step.after.taken,
            **({} if (memory := self._news()) is None else {"memory": memory}),
        )
        await self._patiently(self._journal.durable())
        await self._machine.take(queued.name, quantities, queued.origin, transition)
        now = self._clock.now()
        self._timing = self._timing.stepping(self.mission, step, now)
        self._pending = None
        self._paused = transition.event == "paused"
        self.autonomy = autonomy_after(transition, self.autonomy)
        for name in self._ignored:
            self._watcher.rearm(name)
        self._ignored.clear()
        self._recent.append(Recent(now, queued.name, step.after.leaf))
        self.services.log.info("transition", by=queued.name, state=step.after.leaf, t=round(now, 3))
        await self._begin()
        if self._gate.let_go and self._ended is None:
            self._ended = "released"

    async def _begin(self) -> None:
        """Start what the active leaf does; without a behaviour, hold."""
        state = self.mission.states[self._machine.state]
        self.services.progress.text, self.services.progress.station_m = "", None
        if state.final is not None:
            self._ended = state.final
        elif state.do is None:
            self._hold()
        else:
            self._work.start(behaviours()[state.do], state.parameters)

    async def _stop(self) -> None:
        if not await self._work.stop(self._alive):
            self._hold()
            self._queue.put("behaviour_stuck", {"state": self._machine.state})

    async def _finish(self) -> None:
        """The last lines. A vehicle that is still in the air, and ours, is left in the autopilot's own hold."""
        if not self._gate.let_go:
            with suppress(Exception):
                if self._autopilot.telemetry.in_air:
                    await self._patiently(self._autopilot.hold())
            self._setpoints.stop()
        self._journal_memory(self._clock.now())
        lost = {"lost": self._journal.lost} if self._journal.lost else {}
        self._journal.append("end", self._clock.now(), outcome=self._ended, state=self._machine.state, **lost)
        await self._patiently(self._journal.durable())

    # What the loop is made of

    def _behaviour_ended(self, activation: int, name: str, data: dict[str, Any]) -> None:
        self._queue.put(name, data, activation=activation)

    def _unanswered(self, queued: Queued) -> None:
        """Nobody answers. A limit is watched again in the next state; a behaviour's last word must not be lost."""
        self._ignored.add(queued.name)
        self._recent.append(Recent(self._clock.now(), queued.name, "ignored"))
        self.services.log.warning("event without answer", name=queued.name, state=self._machine.state)
        telemetry = self._autopilot.telemetry
        if event(queued.name).lets_go:
            self._ended = "released"
        elif queued.name in ("abort", "interrupted") and not (telemetry.in_air or telemetry.armed):
            self._ended = "aborted"
        elif queued.activation is not None and queued.name not in EVENTS:
            self._queue.put("behaviour_failed", {"error": f"nothing answers its outcome {queued.name!r}"})

    def _put_question(self, pending: Queued) -> None:
        if self._ask is None or self._loop is None:
            return
        ask = self._ask

        async def put() -> None:
            yes = await ask(self._question(pending))
            if self._pending is pending:
                self.note("confirm" if yes else "refuse", "operator", event=pending.name)
                self.confirm(yes)

        task = self._loop.create_task(put(), name="question")
        self._asking.add(task)
        task.add_done_callback(self._asking.discard)

    def _question(self, pending: Queued) -> Question:
        assert pending.only is not None
        target = semantics.entered_leaf(self.mission, self._machine.configuration, pending.only)
        return Question(pending.name, self._machine.state, target)

    def _hold(self) -> None:
        """Stay here, if setpoints are being sent at all."""
        if self._gate.let_go or self._setpoints.target is None:
            return
        pose = self._autopilot.telemetry.pose
        self._setpoints.target = Setpoint(pose.position.copy(), float(pose.attitude[2]))

    def _let_go(self) -> None:
        """Somebody else flies: no setpoint and no command from now on, and no laser."""
        if self._gate.let_go:
            return
        self._gate.let_go = True
        self._setpoints.stop()
        with suppress(Exception):
            self._perception.watch_blade(False)
        self.services.log.warning("let go of the vehicle")

    def _alive(self) -> None:
        """Say that the executive is alive; notice if it was not."""
        now = asyncio.get_running_loop().time()
        gap, self._alive_s = now - self._alive_s, now
        if gap > STALLED_S and self._setpoints.target is not None:
            self._queue.put("setpoints_stalled", {"gap_s": round(gap, 2)})
        stroke = getattr(self._setpoints, "stroke", None)
        if stroke is not None:
            stroke()

    async def _patiently(self, awaitable: Awaitable[Any]) -> None:
        """Wait without appearing dead."""
        task = asyncio.ensure_future(awaitable)
        while not task.done():
            self._alive()
            await asyncio.wait([task], timeout=PULSE_S)
        task.result()

    async def _fault(self, error: Exception) -> None:
        """An error of the executive itself: abort, and if that does not help either, leave the vehicle holding."""
        self._faults += 1
        self.services.log.exception("executive failed", state=self._machine.state)
        self._journal.append("fault", self._clock.now(), error=f"{type(error).__name__}: {error}"[:300])
        if self._faults >= _MOST_FAULTS:
            await self._stop()
            self._ended = "aborted"
        else:
            self._queue.put("abort", {"error": type(error).__name__})

    def _journal_lost(self, text: str) -> None:
        self.services.log.error("journal lost", text=text)
        self.raise_event_threadsafe("journal_lost", error=text)

    def _journal_event(self, queued: Queued, led_to: str, quantities: Mapping[str, float | bool | None]) -> None:
        guards = {
            name: quantities.get(name)
            for transition in self.mission.handlers(queued.origin or self._machine.state, queued.name)
            for condition in (transition.when, transition.unless)
            if condition is not None
            for name in condition.names
        }
        only = queued.only.key if queued.only else None
        about = {"origin": queued.origin, "only": only, "confirmed": queued.confirmed or None}
        self._journal.append(
            "event",
            self._clock.now(),
            event=queued.name,
            state=self._machine.state,
            led_to=led_to,
            **{name: value for name, value in about.items() if value is not None},
            **({"data": queued.data} if queued.data else {}),
            **({"guards": guards} if guards else {}),
        )

    def _journal_memory(self, now: float) -> None:
        memory = self._news()
        if memory is not None:
            self._journal.append("memory", now, **memory)
        station = self.services.progress.station_m
        if station is not None and round(station, 1) != self._station_m:
            self._station_m = round(station, 1)
            self._journal.append("progress", now, state=self._machine.state, station_m=self._station_m)

    def _news(self) -> dict[str, Any] | None:
        """What the journal has not been told yet of what was found out."""
        memory = asdict(self.services.memory)
        if memory == self._remembered:
            return None
        self._remembered = memory
        return memory

    def _snapshot(self, was_ours: bool = True) -> Snapshot:
        state = self.mission.states[self._machine.state]
        behaviour = self._work.behaviour
        keeps = behaviour is not None and behaviour.keeps_standoff
        return snapshots.take(
            self.services,
            entered_s=self._timing.entered_s.get(state.path, 0.0),
            limits=state.limits or self.mission.limits,
            needs_vision=behaviour is not None and behaviour.needs_vision and self._work.running,
            standoff_m=getattr(state.parameters, "standoff_m", None) if keeps else None,
            was_ours=was_ours,
        )

    def _quantities(self) -> dict[str, float | bool | None]:
        """Values for the guards, rounded as the journal keeps them, so that a replay decides the same."""
        simulated = self._autopilot.simulated
        values = snapshots.quantities(self._snapshot(), self.services.memory, simulated=simulated)
        return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}
