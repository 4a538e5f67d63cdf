"""`mission doctor`: what is not as it should be, and what to do about it."""

from __future__ import annotations

import asyncio
import shutil
import socket
from collections import namedtuple
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mission.cli import checkup
from mission.cli.checkup import Level
from tests.mission.cli.conftest import Call
from tests.mission.cli.program import ROOT
from tests.mission.record.synthetic_run import CAMERA
from vision.camera import LaserGrid, RigGeometry, StereoPair

Usage = namedtuple("Usage", "total used free")


@pytest.fixture(autouse=True)
def at_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def test_this_machine_is_ready_for_the_embedded_simulator(call: Call, tmp_path: Path) -> None:
    said = call("doctor", "--record", tmp_path)
    assert said.code == 0, said.out
    assert said.out.endswith("ready to fly\n")
    for name in ("python", "packages", "simulator", "cores", "record", "rig", "stereo", "laser", "vehicle"):
        assert f" {name} " in said.out


def test_a_port_that_another_program_has_is_named(call: Call, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        number = taken.getsockname()[1]
        said = call("doctor", "--record", tmp_path, "--system", f"udpin://127.0.0.1:{number}")
    assert said.code == 1
    assert f"{number}: address already in use" in said.out
    assert "not ready: 1 of" in said.out


def test_a_nearly_full_disk_and_a_place_that_cannot_be_written_are_bad(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {check.name: check for check in checkup.machine(Path("/dev/null"))}
    assert found["record"].level is Level.BAD
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(100 << 30, 100 << 30, 5 << 20))
    found = {check.name: check for check in checkup.machine(Path("logs"))}
    assert found["record"].level is Level.BAD
    assert "300 MB" in found["record"].remedy


def test_a_missing_package_names_its_installation() -> None:
    check = checkup._packages("simulator", ("numpy", "no-such-distribution"), Level.WARNING, "pip install -e '.[sim]'")
    assert check.level is Level.WARNING
    assert check.found == "missing: no-such-distribution"


@pytest.mark.parametrize(("baseline_m", "level"), [(0.2, Level.OK), (0.02, Level.WARNING)])
def test_a_rig_that_cannot_measure_depth_is_told(baseline_m: float, level: Level) -> None:
    """2.37: a quarter pixel of disparity is Z² δd / (f T): 18 mm at 3 m over 0.2 m, 183 mm over 0.02 m."""
    pair = StereoPair(CAMERA, CAMERA, translation=np.array([0.0, -baseline_m, 0.0]))
    mission: Any = type("M", (), {"rig": type("R", (), {"kind": "hardware", "system": "udp://x:1"}),
                                  "turbine": type("T", (), {"max_chord_m": 3.5})})  # fmt: skip
    found = {check.name: check for check in checkup.rig(mission, RigGeometry(pair, LaserGrid()), 3.0)}
    assert found["stereo"].level is level
    assert f"{1000 * 9 * 0.25 / 616 / baseline_m:.0f} mm" in found["stereo"].found
    assert found["laser"].level is Level.OK
    wide = replace(LaserGrid(), fan=(1.5, 1.5))
    found = {check.name: check for check in checkup.rig(mission, RigGeometry(pair, wide), 3.0)}
    assert found["laser"].level is Level.WARNING


def test_a_vehicle_that_never_answers_is_one_bad_line() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        number = probe.getsockname()[1]
    check = asyncio.run(checkup.vehicle(f"udpin://127.0.0.1:{number}", timeout_s=1.0))
    assert check.level is Level.BAD
    assert str(number) in check.found
    assert "\n" not in check.found
