"""An executive in lockstep time with a small vehicle in memory: a whole flight takes milliseconds."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight.autopilot import Setpoint, Telemetry, VehiclePose
from mission.behaviours import behaviour as registry
from mission.behaviours.behaviour import Behaviour, NoParameters
from mission.executive import conductor as module
from mission.executive import executive as face
from mission.executive import resume
from mission.executive.clock import Clock, LockstepClock, LockstepLoop, WallClock
from mission.executive.executive import Executive, Outcome
from mission.executive.journal import Journal, read_journal
from mission.executive.services import Services
from mission.language.document import Mission, State, Transition
from mission.language.limits import Limits


class MemoryAutopilot:
    """Does at once what it is told, and remembers it."""

    simulated = True

    def __init__(self) -> None:
        self.commands: list[str] = []
        pose = VehiclePose(0.0, np.array([1.0, 2.0, -30.0]), np.zeros(3), np.array([0.0, 0.0, 0.5]), np.zeros(2))
        self.telemetry = Telemetry(
            pose=pose,
            connected=True,
            link_age_s=0.1,
            armed=True,
            in_air=True,
            flight_mode="OFFBOARD",
            armable=True,
            battery_percent=80.0,
            wind=np.zeros(2),
            range_m=None,
            range_age_s=0.0,
            global_position=None,
            position_sigma_m=0.5,
        )

    def says(self, **changes: Any) -> None:
        self.telemetry = replace(self.telemetry, **changes)

    async def hold(self) -> None:
        self.commands.append("hold")

    async def land(self) -> None:
        self.commands.append("land")

    async def take_gimbal(self) -> None:
        self.commands.append("take_gimbal")

    async def start_offboard(self, first: Setpoint) -> None:
        self.commands.append("start_offboard")


class MemorySetpoints:
    """A stream that never sends, but knows whether it would."""

    def __init__(self) -> None:
        self.target: Setpoint | None = Setpoint(np.array([9.0, 9.0, -9.0]), 0.0)
        self.strokes = 0

    async def start(self, first: Setpoint) -> None:
        self.target = first

    def stop(self) -> None:
        self.target = None

    def stroke(self) -> None:
        self.strokes += 1


@dataclass
class MemoryPerception:
    """Sees nothing unless told."""

    observation: Any = None
    seen: Any = None
    watching: bool = False
    vision_age_s: float | None = None
    last_accepted_s: float | None = 0.0
    watching_since_s: float | None = 0.0

    def estimate(self) -> Any:
        return self.seen

    def watch_blade(self, on: bool) -> None:
        self.watching = on

    def record(self, side: str | None) -> None: ...


@dataclass
class Log:
    """Keeps what was logged."""

    lines: list[str] = field(default_factory=list)

    def _write(self, text: str, **about: Any) -> None:
        self.lines.append(f"{text} {about}")

    info = warning = error = exception = _write


Run = Callable[[Services, Any], Awaitable[str]]


@dataclass
class Flight:
    """A mission of `states` with behaviours of its own, flown to its end in lockstep time."""

    mission: Mission
    services: Services
    path: Path
    autonomy: str = "full"
    ask: Any = None
    at: Sequence[tuple[float, Callable[[Executive], Any]]] = ()
    patience_s: float = 600.0
    resume: Any = None
    gone: bool = False
    executive: Executive = field(init=False)

    @property
    def autopilot(self) -> MemoryAutopilot:
        found: Any = self.services.autopilot
        return found

    def run(self) -> Outcome:
        """Fly in lockstep time; at the given times the given things happen."""
        raw = self.services.autopilot, self.services.setpoints

        async def flown() -> Outcome:
            self.prepare(LockstepClock())
            for due, action in self.at:
                asyncio.get_running_loop().call_at(due, action, self.executive)
            return await asyncio.wait_for(self.executive.run(), self.patience_s)

        try:
            with asyncio.Runner(loop_factory=LockstepLoop) as runner:
                return runner.run(flown())
        finally:
            self.services.autopilot, self.services.setpoints = raw

    def run_on_the_wall(self, beside: Callable[[Executive], Awaitable[None]], speed: float = 20.0) -> Outcome:
        """Fly in wall time, something else going on beside it."""

        async def flown() -> Outcome:
            clock = WallClock(speed)
            self.prepare(clock)
            run = asyncio.ensure_future(self.executive.run())
            await beside(self.executive)
            outcome = await asyncio.wait_for(run, 30.0)
            clock.close()
            return outcome

        return asyncio.run(flown())

    def prepare(self, clock: Clock) -> None:
        """The executive, ready to run."""
        self.services.clock = clock
        self.executive = Executive(
            self.mission,
            self.services,
            clock,
            Journal(self.path, sync=False),
            ask=self.ask,
            autonomy=self.autonomy,  # type: ignore[arg-type]
            resume=self.resume,
            gone=lambda: self.gone,
        )
        self.services.raise_event = self.executive.raise_event

    @property
    def journal(self) -> list[tuple[str, Mapping[str, Any]]]:
        return [(entry.kind, entry.fields) for entry in read_journal(self.path)]

    @property
    def walked(self) -> list[str]:
        """Every state that a transition led to."""
        return [str(fields["to"]) for kind, fields in self.journal if kind == "transition"]


def mission_of(
    states: Mapping[str, Mapping[str, Any]], initial: str = "", on: Mapping[str, Any] | None = None
) -> Mission:
    """A mission document without files: as in YAML, targets are absolute paths."""
    found: dict[str, State] = {}

    def transitions(source: str, entries: Mapping[str, Any] | None) -> tuple[Transition, ...]:
        made = []
        for event, entry in (entries or {}).items():
            for index, variant in enumerate(entry if isinstance(entry, list) else [entry]):
                about = {"to": variant} if isinstance(variant, str) else dict(variant)
                made.append(Transition(event, about.pop("to"), source, index=index, **about))
        return tuple(made)

    def add(path: str, parent: str | None, about: Mapping[str, Any]) -> None:
        inner = about.get("states", {})
        children = tuple(f"{path}.{name}" for name in inner)
        known = {name: about.get(name) for name in ("do", "timeout_s", "final", "limits", "parameters")}
        start = f"{path}.{about['initial']}" if "initial" in about else (children[0] if children else None)
        found[path] = State(
            path,
            parent,
            on=transitions(path, about.get("on")),
            initial=start,
            children=children,
            entry=about.get("entry", False),
            **known,
        )
        for name, child in inner.items():
            add(f"{path}.{name}", path, child)

    for name, about in states.items():
        add(name, None, about)
    nothing: Any = None
    return Mission(
        "test",
        1,
        found,
        initial or next(iter(states)),
        nothing,
        nothing,
        nothing,
        None,
        Limits(),
        {},
        "",
        Path("test.yaml"),
        on=transitions("", on),
    )


OUTCOMES = ("done", "found", "failed")


@pytest.fixture
def fly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Flight]:
    """`fly(states, {"behaviour": coroutine}, …)` prepares a flight; `.run()` flies it."""
    known: dict[str, Behaviour] = {}
    for place in (registry, module, face, resume):
        monkeypatch.setattr(place, "behaviours", lambda: known)

    def prepare(
        states: Mapping[str, Mapping[str, Any]],
        runs: Mapping[str, Run] | None = None,
        *,
        on: Mapping[str, Any] | None = None,
        vision: Sequence[str] = (),
        name: str = "journal.jsonl",
        **about: Any,
    ) -> Flight:
        for behaviour, run in {"wait": wait, "finish": finish, **(runs or {})}.items():
            known[behaviour] = Behaviour(
                behaviour, run, NoParameters, dict.fromkeys(OUTCOMES, ""), None, behaviour in vision, ""
            )
        mission = mission_of(states, on=on)
        nothing: Any = None
        autopilot: Any = MemoryAutopilot()
        services = Services(
            clock=nothing,
            autopilot=autopilot,
            setpoints=MemorySetpoints(),
            perception=MemoryPerception(),  # type: ignore[arg-type]
            turbine=nothing,
            mission=mission,
            raise_event=nothing,
            log=Log(),
        )
        services.memory.home = (0.0, 0.0, 0.0)
        return Flight(mission, services, tmp_path / name, **about)

    return prepare


async def wait(services: Services, parameters: Any) -> str:
    """Never ends of itself."""
    while True:
        await services.clock.sleep(1.0)


async def finish(services: Services, parameters: Any) -> str:
    """Is done after a second."""
    await services.clock.sleep(1.0)
    return "done"
