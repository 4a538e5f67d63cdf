"""What `mission doctor` looks at: each check is a function that returns what it found."""

from __future__ import annotations

import os
import platform
import shutil
import socket
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from mission.language.document import Mission
    from vision.camera import RigGeometry

CONNECT_S = 8.0
CORE = ("transitions", "mavsdk", "opencv-python-headless", "numpy", "filterpy", "numba", "pydantic", "structlog")
SIMULATOR = ("pymavlink",)


class Level(StrEnum):
    """How it is."""

    OK = "ok"
    WARNING = "warning"
    BAD = "bad"


@dataclass(frozen=True)
class Check:
    """One line of the table: what was looked at, how it is, what was found and, where it is not ok, what to do."""

    name: str
    level: Level
    found: str
    remedy: str = ""


def machine(logs: Path) -> Iterator[Check]:
    """Interpreter, packages, cores and disk."""
    version = platform.python_version()
    yield Check("python", Level.OK if sys.version_info >= (3, 11) else Level.BAD, version, "install 3.11 or newer")
    yield _packages("packages", CORE, Level.BAD, "pip install -e .")
    yield _packages("simulator", SIMULATOR, Level.WARNING, "pip install -e '.[sim]'")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    enough = Level.OK if cores >= 2 else Level.WARNING
    yield Check("cores", enough, f"{cores}, {platform.machine()}", "vision and control want a core each")
    yield _disk(logs)


def _packages(name: str, distributions: tuple[str, ...], missing_is: Level, remedy: str) -> Check:
    from importlib.metadata import PackageNotFoundError, version

    found, missing = [], []
    for distribution in distributions:
        try:
            found.append(f"{distribution} {version(distribution)}")
        except PackageNotFoundError:
            missing.append(distribution)
    if missing:
        return Check(name, missing_is, f"missing: {', '.join(missing)}", remedy)
    return Check(name, Level.OK, ", ".join(found))


def _disk(logs: Path) -> Check:
    from mission.record.folder import NEEDED_MB

    folder = next(path for path in (logs.absolute(), *logs.absolute().parents) if path.exists())
    free_mb = shutil.disk_usage(folder).free // 2**20
    if not os.access(folder, os.W_OK) or not folder.is_dir():
        return Check("record", Level.BAD, f"{folder} cannot be written", "choose another with --record DIR")
    level = Level.OK if free_mb >= NEEDED_MB else Level.BAD
    return Check("record", level, f"{free_mb / 1024:.1f} GB free in {folder}", f"a run needs {NEEDED_MB} MB")


def rig(mission: Mission, geometry: RigGeometry, standoff_m: float) -> Iterator[Check]:
    """The rig of a mission, and what its cameras make of a blade at the standoff."""
    import numpy as np

    left, baseline_m = geometry.stereo.left, geometry.stereo.baseline_m
    yield Check("rig", Level.OK, f"{mission.rig.kind}, {left.width} × {left.height} px, system {mission.rig.system}")
    across_m = standoff_m * left.width / left.fx
    view = f"{across_m:.1f} m across at {standoff_m:g} m, {1000 * standoff_m / left.fx:.1f} mm a pixel"
    chord_m = mission.turbine.max_chord_m
    yield Check("view", Level.OK, f"{view}; the widest chord is {chord_m:g} m")
    disparity = left.fx * baseline_m / standoff_m
    sigma_mm = 1000 * standoff_m**2 * 0.25 / (left.fx * baseline_m)
    enough = Level.OK if sigma_mm <= 50 else Level.WARNING
    found = (
        f"{1000 * baseline_m:.0f} mm baseline: {disparity:.0f} px disparity, about {sigma_mm:.0f} mm a quarter pixel"
    )
    yield Check("stereo", enough, found, "a longer baseline or lens measures depth better")
    if geometry.laser is None:
        yield Check("laser", Level.WARNING, "none", "without structured light the blade's distance cannot be measured")
        return
    fan, lens = geometry.laser.fan[0], 2 * np.arctan(left.width / 2 / left.fx)
    dots = f"{geometry.laser.rows} × {geometry.laser.columns} dots over {np.rad2deg(fan):.0f}°"
    fits = Level.OK if fan <= lens else Level.WARNING
    yield Check("laser", fits, f"{dots} of a view of {np.rad2deg(lens):.0f}°", "dots outside the view are wasted")


def port(system: str) -> Check:
    """Whether the port that the vehicle is expected on is free to listen on."""
    parts = urlsplit(system)
    if parts.scheme not in ("udpin", "udp", "tcpin") or parts.port is None:
        return Check("port", Level.OK, f"{system}: nothing to listen on")
    kind = socket.SOCK_STREAM if parts.scheme == "tcpin" else socket.SOCK_DGRAM
    with socket.socket(socket.AF_INET, kind) as probe:
        try:
            probe.bind((parts.hostname or "0.0.0.0", parts.port))
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            return Check("port", Level.BAD, f"{parts.port}: {reason}", "end the other program or choose another port")
    return Check("port", Level.OK, f"{parts.port} is free")


async def vehicle(system: str, timeout_s: float = CONNECT_S) -> Check:
    """Whether a vehicle answers."""
    from flight.autopilot import AutopilotError
    from flight.mavsdk_link import MavsdkAutopilot
    from mission.executive.clock import WallClock

    clock = WallClock()
    autopilot = MavsdkAutopilot(system, clock)
    try:
        await autopilot.connect(timeout_s)
        telemetry = autopilot.telemetry
        battery = f", battery {telemetry.battery_percent:.0f} %" if telemetry.battery_percent >= 0 else ""
        return Check("vehicle", Level.OK, f"answers at {system}: {telemetry.flight_mode or 'no mode yet'}{battery}")
    except AutopilotError as error:
        return Check("vehicle", Level.BAD, str(error), "is it switched on, and does it send to this port?")
    finally:
        await autopilot.close()
        clock.close()
