"""How long the executive takes from an event to the transition, journalled with fsync and without a disk."""

from __future__ import annotations

import asyncio
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from flight.autopilot import Telemetry, VehiclePose
from mission.behaviours.behaviour import behaviours
from mission.executive import conductor
from mission.executive.clock import WallClock
from mission.executive.executive import Executive
from mission.executive.journal import Journal
from mission.executive.services import Services
from mission.language.document import Mission, load
from mission.language.semantics import Configuration

EVENTS = 1000
START = "inspect.survey"
"""`paused` and `resumed` lead from here to `holding` and back, with deep history."""


class Stopwatch:
    """Stands in for the log: it is told of a transition the moment the machine has moved."""

    def __init__(self) -> None:
        self.moved = asyncio.Event()
        self.at = 0.0

    def info(self, text: str, **about: Any) -> None:
        if text == "transition":
            self.at = time.perf_counter()
            self.moved.set()

    def warning(self, text: str, **about: Any) -> None: ...

    error = exception = warning


async def wait(services: Services, parameters: Any) -> str:
    """Stands in for every behaviour."""
    await asyncio.sleep(1e6)
    return ""


def table() -> list[str]:
    """Two lines of figures in milliseconds."""
    mission = load("missions/v80_blade.yaml")
    idle = {name: replace(entry, run=wait) for name, entry in behaviours().items()}
    conductor.behaviours = lambda: idle  # type: ignore[attr-defined]
    with tempfile.TemporaryDirectory() as folder:
        rows = {
            "without disk": measure(mission, None),
            "with fsync": measure(mission, Path(folder) / "journal.jsonl"),
        }
    lines = [f"event to transition, {EVENTS} events, ms    p50     p90     p99     most"]
    for name, seconds in rows.items():
        figures = 1e3 * np.array([*np.quantile(seconds, (0.5, 0.9, 0.99)), seconds.max()])
        lines.append(f"  {name:36}" + "".join(f"{figure:8.2f}" for figure in figures))
    return lines


def measure(mission: Mission, journal: Path | None) -> np.ndarray:
    """Seconds of each event (n,)."""

    async def flown() -> np.ndarray:
        clock, watch = WallClock(), Stopwatch()
        executive = Executive(mission, _services(mission, clock, watch), clock, Journal(journal, threaded=True))
        executive._machine = type(executive._machine)(mission, Configuration(START))
        run = asyncio.ensure_future(executive.run())
        await asyncio.sleep(0.5)
        taken = []
        for number in range(EVENTS):
            watch.moved.clear()
            raised = time.perf_counter()
            executive.raise_event("resumed" if number % 2 else "paused")
            await asyncio.wait_for(watch.moved.wait(), 5.0)
            taken.append(watch.at - raised)
            await asyncio.sleep(0.002)
        run.cancel()
        await asyncio.gather(run, return_exceptions=True)
        clock.close()
        return np.array(taken)

    return asyncio.run(flown())


def _services(mission: Mission, clock: WallClock, watch: Stopwatch) -> Services:
    pose = VehiclePose(0.0, np.array([0.0, 0.0, -30.0]), np.zeros(3), np.zeros(3), np.zeros(2))
    telemetry = Telemetry(pose, True, 0.0, True, True, "HOLD", True, 90.0, None, None, 0.0, None, 0.5)
    stub: Any = SimpleNamespace(
        simulated=True,
        telemetry=telemetry,
        target=None,
        stop=lambda: None,
        stroke=lambda: None,
        observation=None,
        estimate=lambda: None,
        watch_blade=lambda on: None,
        record=lambda side: None,
        hub=np.array([40.0, 0.0, -78.0]),
        heading=0.0,
        axes=lambda: tuple(np.eye(3)),
    )
    nothing: Any = None
    return Services(clock, stub, stub, stub, stub, mission, nothing, watch)


if __name__ == "__main__":
    print("\n".join(table()))
