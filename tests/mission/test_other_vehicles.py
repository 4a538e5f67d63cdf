"""Vehicles that the mission did not start itself: `mission simulate` stands in for PX4 SITL and for a real one."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pymavlink", reason="the simulated vehicle speaks through pymavlink")

from flight.mavsdk_link import MavsdkAutopilot
from mission.executive.clock import WallClock
from tests.mission.test_flights import ROOT, SQUARE, fly, summary

LOW = (
    "states.launch.with.height_m=2.5",
    *(f"states.square.states.{corner}.with.height_m=2.5" for corner in ("north", "east", "south", "west")),
    "states.square.states.north.with.north_m=1",
    "states.square.states.east.with.north_m=1",
    "states.square.states.east.with.east_m=1",
    "states.square.states.south.with.east_m=1",
)
STOCK = ("--param", "COM_OBL_RC_ACT=0", "--param", "COM_OF_LOSS_T=5")
SITL = "missions/rigs/px4_sitl.yaml"

Simulate = Callable[..., str]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def simulate() -> Iterator[Simulate]:
    """Start a vehicle with options of `mission simulate`; returns where to listen to it."""
    started: list[subprocess.Popen[str]] = []

    def start(*options: str) -> str:
        port = free_port()
        command = [sys.executable, "-m", "mission", "simulate", "--port", str(port), "--listen", "0"]
        process = subprocess.Popen(
            [*command, "--station-port", "0", *options], cwd=ROOT, stdout=subprocess.PIPE, text=True
        )
        started.append(process)
        assert process.stdout is not None
        told: dict[str, Any] = json.loads(process.stdout.readline())
        assert told["links"]
        return f"udpin://127.0.0.1:{port}"

    yield start
    for process in started:
        process.terminate()
        process.communicate(timeout=20)


async def held_by(system: str, *names: str) -> dict[str, float]:
    clock = WallClock()
    autopilot = MavsdkAutopilot(system, clock)
    try:
        await autopilot.connect(20)
        return dict(await autopilot.parameters(names))
    finally:
        await autopilot.close()
        clock.close()


async def test_stock_px4_values_are_replaced_by_the_rig_s_and_the_mission_flies(
    simulate: Simulate, tmp_path: Path
) -> None:
    system = simulate("--speed", "4", *STOCK)
    before = await held_by(system, "COM_OBL_RC_ACT", "COM_OF_LOSS_T")
    assert before == {"COM_OBL_RC_ACT": 0, "COM_OF_LOSS_T": 5}
    done = fly(SQUARE, tmp_path, "--rig", SITL, "--system", system, "--speed", "4")
    assert done.returncode == 0, done.stdout + done.stderr
    after = await held_by(system, "COM_OBL_RC_ACT", "COM_OF_LOSS_T")
    assert after == {"COM_OBL_RC_ACT": 5, "COM_OF_LOSS_T": 4}


def test_a_vehicle_in_another_time_is_refused_with_the_factor(simulate: Simulate, tmp_path: Path) -> None:
    system = simulate("--speed", "4")
    done = fly(SQUARE, tmp_path, "--system", system)
    assert done.returncode == 3, done.stdout + done.stderr
    assert done.stderr.count("\n") == 1
    assert "the vehicle's time runs" in done.stderr and "--speed" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_rig_without_cameras_flies_what_needs_no_image(simulate: Simulate, tmp_path: Path) -> None:
    rig = tmp_path / "drone.yaml"
    rig.write_text(f"kind: hardware\nsystem: {simulate()}\ncamera_driver: none\n")
    done = fly(SQUARE, tmp_path / "logs", "--rig", str(rig), "--yes", *(f"--set={change}" for change in LOW))
    assert done.returncode == 0, done.stdout + done.stderr
    assert summary(tmp_path / "logs")["outcome"] == "completed"
