"""How long the executive takes from an event to the transition, journalled with fsync and without a disk."""

from __future__ import annotations

import asyncio
import gc
import os
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
        self.at = self.cpu = 0.0

    def info(self, text: str, **about: Any) -> None:
        if text == "transition":
            self.at, self.cpu = time.perf_counter(), time.thread_time()
            self.moved.set()

    def warning(self, text: str, **about: Any) -> None: ...

    error = exception = warning


async def wait(services: Services, parameters: Any) -> str:
    """Stands in for every behaviour."""
    await asyncio.sleep(1e6)
    return ""


def table() -> list[str]:
    """Lines of figures in milliseconds. What the machine adds stands beside: the processor's own time of the same
    events, which waits for nobody, and as many lines written and synchronised by nothing but a file."""
    mission = load("missions/v80_blade.yaml")
    idle = {name: replace(entry, run=wait) for name, entry in behaviours().items()}
    conductor.behaviours = lambda: idle  # type: ignore[assignment, attr-defined]
    with tempfile.TemporaryDirectory() as folder:
        without, with_fsync = measure(mission, None), measure(mission, Path(folder) / "journal.jsonl")
        rows = {
            "without disk": without[0],
            "  processor time of that": without[1],
            "with fsync": with_fsync[0],
            "  a bare fsync meanwhile": bare(Path(folder) / "bare.jsonl"),
        }
    lines = [f"event to transition, {EVENTS} events, ms    p50     p90     p99     most"]
    for name, seconds in rows.items():
        figures = 1e3 * np.array([*np.quantile(seconds, (0.5, 0.9, 0.99)), seconds.max()])
        lines.append(f"  {name:36}" + "".join(f"{figure:8.2f}" for figure in figures))
    return lines


def bare(path: Path) -> np.ndarray:
    """Seconds that lines as long as the journal's take to the disk (n,)."""
    taken = []
    with path.open("ab", buffering=0) as file:
        for _ in range(EVENTS):
            began = time.perf_counter()
            file.write(b"x" * 400 + b"\n")
            os.fsync(file.fileno())
            taken.append(time.perf_counter() - began)
            time.sleep(0.002)
    return np.array(taken)


def measure(mission: Mission, journal: Path | None) -> np.ndarray:
    """Seconds of each event, and the event loop's processor time of it (2, n)."""

    async def flown() -> np.ndarray:
        clock, watch = WallClock(), Stopwatch()
        executive = Executive(mission, _services(mission, clock, watch), clock, Journal(journal, threaded=True))
        executive._machine = type(executive._machine)(mission, Configuration(START))
        run = asyncio.ensure_future(executive.run())
        await asyncio.sleep(0.5)
        taken = []
        gc.collect()
        gc.freeze()  # as the assembly does before a flight
        async with asyncio.timeout(60.0):
            for number in range(EVENTS):
                watch.moved.clear()
                raised, cpu = time.perf_counter(), time.thread_time()
                executive.raise_event("resumed" if number % 2 else "paused")
                await watch.moved.wait()
                taken.append((watch.at - raised, watch.cpu - cpu))
                await asyncio.sleep(0.002)
        run.cancel()
        await asyncio.gather(run, return_exceptions=True)
        clock.close()
        return np.array(taken).T

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
