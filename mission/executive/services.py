"""What a behaviour is given to work with: everything it may touch, and nothing else."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from mission.executive.commanded import Commanded

if TYPE_CHECKING:
    from flight.autopilot import Autopilot, Setpoint
    from flight.keepout import KeepOut
    from flight.turbine import Turbine
    from mission.executive.clock import Clock
    from mission.executive.perception import FarSight
    from mission.language.document import Mission
    from vision.estimate import BladeEstimate, BladeFrame
    from vision.landmarks import TipSighting
    from vision.observation import BladeObservation


class RaiseEvent(Protocol):
    """Queue an event of the event table, with data for the journal. Safe from any coroutine of the loop."""

    def __call__(self, name: str, **data: Any) -> None: ...


class SetpointStream(Protocol):
    """Streams the target at a fixed rate for as long as the executive is alive, bounded by the keep-out volume."""

    target: Setpoint | None
    keep_out: KeepOut | None

    async def start(self, first: Setpoint) -> None:
        """Begin with a first target and switch the autopilot to OFFBOARD."""
        ...

    def stop(self) -> None:
        """Stop streaming; the autopilot must already have been given another mode."""
        ...


class Perception(Protocol):
    """The vision loop: it runs at its own rate and never delays the setpoints."""

    observation: BladeObservation | None
    frame: BladeFrame
    tips: Sequence[TipSighting]

    def chord(self, station_m: float) -> float | None:
        """Chord (m) at a station from all edges seen so far; None where one of them was not."""
        ...

    def estimate(self) -> BladeEstimate | None:
        """The tracked blade predicted to now and seen from the present pose; None before it was first seen."""
        ...

    async def next_observation(self) -> BladeObservation:
        """Wait for the next cycle and return its observation, valid or refused."""
        ...

    async def far_view(self) -> FarSight:
        """Take one picture without laser and look for the rotor; with the pose it was taken from."""
        ...

    async def photograph(self, subject: str) -> bool:
        """Take one picture without laser and record it under a subject; False when none came."""
        ...

    def watch_blade(self, on: bool) -> None:
        """Start or stop the close-up cycle (laser, stereo, tracker)."""
        ...

    def forget(self) -> None:
        """Make the tracker forget what it saw, as after a change of side."""
        ...

    def record(self, side: str | None) -> None:
        """Record frames of this side from now on; None stops recording."""
        ...


@dataclass
class Progress:
    """What the live view shows of the behaviour that runs; behaviours write it, nobody reads decisions from it."""

    text: str = ""
    station_m: float | None = None


@dataclass(frozen=True)
class Stretch:
    """How much of one side has been flown along: from one station (m from the hub) to another, and at which offset (m,
    in the blade frame) its edge was there."""

    from_m: float
    to_m: float
    edge_m: float


@dataclass
class Memory:
    """What behaviours found out and later ones rely on; journalled at every transition, back on resume. inspected: side
    → how far the pass along it has come, begun or done."""

    home: tuple[float, float, float] | None = None
    hub: tuple[float, float, float] | None = None
    heading: float | None = None
    azimuth: float | None = None
    tip_station_m: float | None = None
    root_station_m: float | None = None
    passes_done: list[str] = field(default_factory=list)
    inspected: dict[str, Stretch] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)


async def _nothing_to_keep() -> None: ...


@dataclass
class Services:
    """One run's services. `turbine` is what is believed of it, refined by the survey; never the simulated truth.

    `await keep()` returns once what is in `memory` is in the journal: before something that cannot be undone.
    """

    clock: Clock
    autopilot: Autopilot
    setpoints: SetpointStream
    perception: Perception
    turbine: Turbine
    mission: Mission
    raise_event: RaiseEvent
    log: Any
    rig: Any = None
    progress: Progress = field(default_factory=Progress)
    memory: Memory = field(default_factory=Memory)
    commanded: Commanded = field(default_factory=Commanded)
    locate: Callable[[Sequence[FarSight]], Turbine | None] = lambda sights: None
    on_turbine_refined: Callable[[Turbine], None] = lambda turbine: None
    keep: Callable[[], Awaitable[None]] = _nothing_to_keep

    @property
    def streaming(self) -> bool:
        """Whether setpoints are being sent now."""
        return bool(getattr(self.setpoints, "streaming", self.setpoints.target is not None))

    @property
    def ours(self) -> bool:
        """Whether the flight mode may be this program's own doing; else somebody else flies."""
        return self.commanded.covers(self.autopilot.telemetry.flight_mode, streaming=self.streaming)

    def refine_turbine(self, turbine: Turbine) -> None:
        """Believe another turbine from now on: keep-out, tracker and monitors follow."""
        self.turbine = turbine
        self.memory.hub = (float(turbine.hub[0]), float(turbine.hub[1]), float(turbine.hub[2]))
        self.memory.heading, self.memory.azimuth = turbine.heading, turbine.azimuth
        for name in ("hub_sigma_m", "heading_sigma", "azimuth_sigma"):
            self.memory.values[name] = float(getattr(turbine, name))
        self.on_turbine_refined(turbine)

    async def ticks(self, rate_hz: float = 20.0) -> AsyncIterator[float]:
        """Yield the mission time `rate_hz` times a mission second, but never more than 50 times a wall second."""
        while True:
            yield self.clock.now()
            await self.clock.sleep(max(1.0 / rate_hz, self.clock.speed / 50.0))
