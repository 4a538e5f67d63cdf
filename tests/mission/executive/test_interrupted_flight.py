"""A whole mission on the simulated vehicle, killed in the middle of it and gone on with: it completes or lands."""

from __future__ import annotations

import asyncio
import random
from pathlib import Path
from typing import Any

import pytest

from devices.vehicle.settings import VehicleSettings
from devices.vehicle.vehicle import SimulatedVehicle
from flight.lockstep_link import LockstepAutopilot
from flight.setpoints import SetpointStream
from mission.executive.clock import LockstepClock, LockstepLoop
from mission.executive.executive import Executive, Outcome
from mission.executive.journal import Journal, read_journal
from mission.executive.replay import replay
from mission.executive.resume import interrupted, restore, where
from mission.executive.services import Services
from mission.language.document import Mission, load


class Killed(KeyboardInterrupt):
    """Stands for SIGKILL: the event loop ends at once."""


class Blind:
    """A rig without eyes: this mission needs none."""

    observation = None

    def estimate(self) -> None:
        return None

    def watch_blade(self, on: bool) -> None: ...

    def record(self, side: str | None) -> None: ...


class Aircraft:
    """One vehicle that outlives the programs which fly it."""

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.autopilot = LockstepAutopilot(SimulatedVehicle(VehicleSettings(), seed=1))
        self.autopilot.advance(6.0)
        self.seconds = 6.0
        self.highest_m = 0.0

    def pass_time(self, seconds: float) -> None:
        self.autopilot.advance(seconds)
        self.seconds += seconds
        self.highest_m = max(self.highest_m, -float(self.autopilot.vehicle.pose().position[2]))

    def fly(
        self,
        journal: Path,
        log: Any,
        *,
        kill_after_s: float | None = None,
        past: Any = None,
        abort_after_s: float | None = None,
    ) -> Outcome:
        """One program's flight, until its end or until it is killed."""

        async def flown() -> Outcome:
            clock, nothing = LockstepClock(self.seconds), None
            await self.autopilot.connect(5.0)
            stream = SetpointStream(self.autopilot, clock, None, wall=clock.now)
            services = Services(
                clock=clock,
                autopilot=self.autopilot,
                setpoints=stream,
                perception=Blind(),  # type: ignore[arg-type]
                turbine=nothing,  # type: ignore[arg-type]
                mission=self.mission,
                raise_event=lambda name, **data: executive.raise_event(name, **data),
                log=log,
            )
            resume = None
            if past is not None:
                in_air = self.autopilot.telemetry.in_air
                restore(services, past, in_air=in_air)
                resume = where(self.mission, past, in_air=in_air)
            executive = Executive(self.mission, services, clock, Journal(journal, sync=False), resume=resume)
            if abort_after_s is not None:
                asyncio.get_running_loop().call_later(abort_after_s, executive.raise_event, "abort")
            if kill_after_s is not None:
                asyncio.get_running_loop().call_later(kill_after_s, kill)
            return await asyncio.wait_for(executive.run(), 1000.0)

        with asyncio.Runner(loop_factory=lambda: LockstepLoop(self.pass_time)) as runner:
            return runner.run(flown())


def kill() -> None:
    raise Killed


@pytest.fixture(scope="module")
def square() -> Mission:
    return load("missions/square.yaml")


INSTANTS = random.Random(4).choices([number / 100 for number in range(1, 3950)], k=100)


@pytest.mark.slow
@pytest.mark.parametrize("kill_after_s", INSTANTS)
def test_killed_at_a_hundred_instants(square: Mission, tmp_path: Path, silent: Any, kill_after_s: float) -> None:
    test_killed_at_any_time_it_completes_or_lands(square, tmp_path, silent, kill_after_s, kill_after_s % 5.0)


@pytest.mark.parametrize(
    "kill_after_s, dead_s", [(0.5, 0.3), (4.0, 0.3), (7.0, 20.0), (13.0, 0.3), (24.0, 20.0), (33.0, 2.0)]
)
def test_killed_at_any_time_it_completes_or_lands(
    square: Mission, tmp_path: Path, silent: Any, kill_after_s: float, dead_s: float
) -> None:
    aircraft = Aircraft(square)
    with pytest.raises(Killed):
        aircraft.fly(tmp_path / "first.jsonl", silent, kill_after_s=kill_after_s)
    aircraft.pass_time(dead_s)
    past = interrupted(tmp_path / "first.jsonl", square)
    outcome = aircraft.fly(tmp_path / "second.jsonl", silent, past=past)
    assert outcome.outcome in ("completed", "aborted")
    telemetry = aircraft.autopilot.telemetry
    assert not telemetry.armed and not telemetry.in_air
    assert aircraft.highest_m < 8.0
    flown = [
        entry.fields["to"]
        for entry in (*read_journal(tmp_path / "first.jsonl"), *read_journal(tmp_path / "second.jsonl"))
        if entry.kind == "transition"
    ]
    corners = [state for state in flown if state.startswith("square.")]
    assert len(corners) == len(set(corners))
    for journal in ("first.jsonl", "second.jsonl"):
        assert asyncio.run(differences(tmp_path / journal, square)) == []


@pytest.mark.parametrize(
    "abort_after_s, dead_s", [(1.5, 0.3), (1.5, 20.0), (6.0, 0.3), (10.0, 20.0), (20.0, 0.3), (20.0, 30.0)]
)
def test_killed_on_its_way_home_from_an_abort_it_still_lands(
    square: Mission, tmp_path: Path, silent: Any, abort_after_s: float, dead_s: float
) -> None:
    aircraft = Aircraft(square)
    with pytest.raises(Killed):
        aircraft.fly(tmp_path / "first.jsonl", silent, abort_after_s=abort_after_s, kill_after_s=abort_after_s + 2.0)
    aircraft.pass_time(dead_s)
    outcome = aircraft.fly(tmp_path / "second.jsonl", silent, past=interrupted(tmp_path / "first.jsonl", square))
    assert outcome.outcome == "aborted"
    assert not aircraft.autopilot.telemetry.armed
    entered = [entry.fields["to"] for entry in read_journal(tmp_path / "second.jsonl") if entry.kind == "transition"]
    assert not [state for state in entered if state.startswith(("square", "launch"))]


def test_an_aborted_flight_is_flown_again_from_the_ground(square: Mission, tmp_path: Path, silent: Any) -> None:
    """As after a change of battery."""
    aircraft = Aircraft(square)
    assert aircraft.fly(tmp_path / "first.jsonl", silent, abort_after_s=15.0).outcome == "aborted"
    past = interrupted(tmp_path / "first.jsonl", square)
    assert past.ended == "aborted"
    assert aircraft.fly(tmp_path / "second.jsonl", silent, past=past).outcome == "completed"


async def differences(journal: Path, mission: Mission) -> list[str]:
    return [played.difference async for played in replay(journal, mission) if played.difference is not None]


@pytest.fixture
def silent() -> Any:
    class Log:
        def info(self, *text: Any, **about: Any) -> None: ...

        warning = error = exception = info

    return Log()
