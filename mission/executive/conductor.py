"""The conductor: queue, machine, behaviour and journal brought together, one event after the other.

Stop the old behaviour, write the transition to the journal, move the machine, start the new behaviour: in this order.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from mission.behaviours.behaviour import behaviours
from mission.executive import snapshot as snapshots
from mission.executive.chronicle import Chronicle
from mission.executive.decision import Autonomy, autonomy_after, decide
from mission.executive.events import EVENTS, event
from mission.executive.gate import Gate, guard_services
from mission.executive.helm import Helm
from mission.executive.journal import SLOWEST_DISK_S, Journal
from mission.executive.machine import Machine
from mission.executive.operator import at_the_keyboard
from mission.executive.question import Ask, Question, Questions
from mission.executive.queue import EventQueue, Queued
from mission.executive.silence import Silence
from mission.executive.snapshot import Snapshot
from mission.executive.status import Recent
from mission.executive.timing import Timing, Waiting
from mission.executive.watch import Watcher
from mission.executive.work import Work
from mission.language import semantics
from mission.language.document import Mission, Transition
from mission.language.semantics import Configuration, Quantities

if TYPE_CHECKING:
    from mission.executive.clock import Clock
    from mission.executive.services import Services


class Conductor:
    """Carries every event to its end before the next. One task hands them to it.

    services: put behind a gate, in place, so that an abandoned behaviour cannot steer. ask: how an operator is asked;
    without it a transition that needs a yes waits for `confirm`. resume: where an interrupted run goes on. gone:
    whether the vehicle is known not to exist any more.
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
        gone: Callable[[], bool] = lambda: False,
    ) -> None:
        self.mission, self.services, self.autonomy = mission, services, autonomy
        self._clock, self._resumed = clock, resume is not None
        self._autopilot = services.autopilot
        self._gate = Gate()
        services.commanded.resumed = self._resumed
        services.keep = self._keep
        self._queue = EventQueue()
        self._helm = Helm(services, self._gate, lambda gap_s: self.raise_event("setpoints_stalled", gap_s=gap_s))
        guard_services(services, self._gate)
        self._machine = Machine(mission, resume)
        self._work = Work(services, self._gate, self._behaviour_ended)
        self._watcher = Watcher(self._snapshot, self.raise_event, services.log, airborne=self._resumed)
        self._chronicle = Chronicle(journal, clock, mission, services)
        self._questions = Questions(ask, self._answered)
        self._timing = Timing()
        self._recent: deque[Recent] = deque(maxlen=8)
        self._ignored: set[str] = set()
        self._paused = False
        self._ended: str | None = None
        self._why: str | None = None
        self._silence = Silence(gone)

    @property
    def state(self) -> str:
        """Path of the active leaf."""
        return self._machine.state

    def raise_event(self, name: str, **data: Any) -> None:
        """Queue an event of the table or an outcome. From the event loop's thread.

        Raises:
            EventError: nobody declared it.
        """
        entry = event(name)
        if entry.lets_go:
            self._helm.let_go()
        if entry.raised_by == "operator" and "by" in data:
            about = {key: value for key, value in data.items() if key != "by"}
            self._chronicle.acts(name, str(data["by"]), soon=True, **about)  # with the event, one write
        self._queue.put(name, data)

    @property
    def question(self) -> Question | None:
        """What an operator may answer now."""
        return self._questions.open

    def confirm(self, yes: bool) -> str:
        """Answer the open question; returns what becomes of it, for the operator to read."""
        pending = self._questions.answer(yes)
        if pending is None:
            return "nothing waits for an answer"
        if not yes:
            self.services.progress.text = f"{pending.name} was refused; `step` follows it after all"
            return f"{pending.name} is not followed; the vehicle holds in {self.state}"
        about = {"activation": pending.activation, "origin": pending.origin, "only": pending.only}
        self._queue.put(pending.name, pending.data, confirmed=True, **about)
        return f"{pending.name} is followed"

    def note(self, command: str, who: str, **about: Any) -> None:
        """Write an operator's act to the journal."""
        self._chronicle.acts(command, who, **about)

    async def _handle(self, queued: Queued) -> None:
        if queued.activation is not None and queued.activation != self._work.activation:
            self._chronicle.happened(queued, "stale", self.state, {})
            return
        if queued.name == "step" and self._questions.open is not None:
            self._chronicle.happened(queued, "confirmation", self.state, {})
            self.confirm(True)
            return
        quantities = self._quantities() if self._asked(queued) else {}
        decision = decide(self.mission, self._machine.configuration, queued, quantities, self.autonomy)
        self._chronicle.happened(queued, decision.led_to, self.state, quantities)
        transition = decision.transition
        if decision.led_to == "ignored":
            self._unanswered(queued)
        elif transition is None:
            return
        elif decision.led_to == "delayed":
            due_s = self._clock.now() + decision.delay_s
            self._timing = self._timing.delaying(Waiting(due_s, queued.name, transition))
        elif decision.led_to == "asked":
            target = semantics.entered_leaf(self.mission, self._machine.configuration, transition)
            self._questions.put(replace(queued, only=transition), Question(queued.name, self.state, target))
        else:
            await self._go(queued, transition, quantities)

    async def _go(self, queued: Queued, transition: Transition, quantities: Quantities) -> None:
        """One transition: stop, journal, move, start."""
        if event(transition.event).lets_go:
            self._helm.let_go()
        await self._stop()
        step = semantics.take(self.mission, self._machine.configuration, transition, queued.name)
        self._chronicle.steps(step)
        if self._chronicle.journal.pending:
            await self._helm.patiently(self._chronicle.journal.durable(), SLOWEST_DISK_S)
        await self._machine.take(queued.name, quantities, queued.origin, transition, step)
        now = self._clock.now()
        self._timing = self._timing.stepping(self.mission, step, now)
        self._questions.forget()
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

    async def _keep(self) -> None:
        """Have what was found out in the journal, within what a slow disk may take."""
        self._chronicle.found_out(self.state)
        with suppress(TimeoutError):
            await asyncio.wait_for(asyncio.shield(self._chronicle.journal.durable()), SLOWEST_DISK_S)

    async def _begin(self) -> None:
        """Start what the active leaf does; without a behaviour, hold."""
        state = self.mission.states[self.state]
        self.services.progress.text, self.services.progress.station_m = "", None
        if state.final is not None:
            self._ended = state.final
        elif state.do is None:
            self._helm.hold()
        else:
            self._work.start(behaviours()[state.do], state.parameters)

    async def _stop(self) -> None:
        if not await self._work.stop(self._helm.beat):
            self._helm.hold()
            self._queue.put("behaviour_stuck", {"state": self.state})

    def _answered(self, yes: bool) -> None:
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        self.note("confirm" if yes else "refuse", at_the_keyboard(), at=at)
        self.confirm(yes)

    def _behaviour_ended(self, activation: int, name: str, data: dict[str, Any]) -> None:
        self._queue.put(name, data, activation=activation)

    def _unanswered(self, queued: Queued) -> None:
        """Nobody answers. A limit is watched again in the next state; a behaviour's last word must not be lost."""
        self._ignored.add(queued.name)
        self._recent.append(Recent(self._clock.now(), queued.name, "ignored"))
        self.services.log.warning("event without answer", name=queued.name, state=self.state)
        telemetry = self._autopilot.telemetry
        if event(queued.name).lets_go:
            self._ended = "released"
        elif queued.name in ("abort", "interrupted") and not (telemetry.in_air or telemetry.armed):
            self._ended = "aborted"
        elif queued.activation is not None and queued.name not in EVENTS:
            self._queue.put("behaviour_failed", {"error": f"nothing answers its outcome {queued.name!r}"})

    def _snapshot(self, was_ours: bool = True) -> Snapshot:
        state = self.mission.states[self.state]
        behaviour = self._work.behaviour
        keeps = behaviour is not None and behaviour.keeps_standoff
        self.services.commanded.reported(self._autopilot.telemetry.flight_mode)
        return snapshots.take(
            self.services,
            entered_s=self._timing.entered_s.get(state.path, 0.0),
            limits=state.limits or self.mission.limits,
            needs_vision=behaviour is not None and behaviour.needs_vision and self._work.running,
            standoff_m=getattr(state.parameters, "standoff_m", None) if keeps else None,
            was_ours=was_ours,
        )

    def _asked(self, queued: Queued) -> bool:
        """Whether any guard has a say in what this event leads to."""
        handlers = self.mission.handlers(queued.origin or self.state, queued.name)
        return any(transition.guarded for transition in handlers)

    def _quantities(self) -> dict[str, float | bool | None]:
        """Values for the guards, rounded as the journal keeps them, so that a replay decides the same."""
        simulated = self._autopilot.simulated
        values = snapshots.quantities(self._snapshot(), self.services.memory, simulated=simulated)
        return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}
