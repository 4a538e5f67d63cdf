"""A run's folder as a flight would leave it, written by the real recorders from a made-up flight of known figures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from flight.autopilot import Setpoint, Telemetry, VehiclePose
from mission.executive.journal import FORMAT
from mission.record.folder import RunFolder, create
from mission.record.recorder import RunRecorder
from mission.record.run_log import RunLog
from vision.camera import Camera
from vision.capture import CameraPose, StereoFrames
from vision.estimate import BladeEstimate, SideEstimate
from vision.observation import BladeObservation, Line
from vision.tracker import UpdateResult

CAMERA = Camera(612, 512, 616.0, 616.0, 305.5, 255.5)
ROOT_M, TIP_M = 1.0, 40.0

MISSION = """\
mission: v80_blade
version: 1
turbine: {name: Vestas V80, root_radius_m: 1.0, blade_length_m: 39.0}
rig: {kind: simulated}
parameters: {standoff_m: 3.0}
states:
  inspect:
    initial: leading
    states:
      leading: {do: follow_edge, with: {side: leading, standoff_m: 3.0}}
      trailing: {do: follow_edge, with: {side: trailing, standoff_m: 3.0}}
  completed: {final: true, outcome: completed}
"""

JOURNAL = (
    {"t": 0.0, "kind": "start", "mission": "v80_blade", "format": FORMAT, "resumed": False, "state": "preflight"},
    {"t": 2.0, "kind": "transition", "event": "passed", "by": "passed", "from": "preflight", "to": "launch"},
    {"t": 14.0, "kind": "transition", "event": "done", "by": "done", "from": "launch", "to": "inspect.survey"},
    {
        "t": 60.0,
        "kind": "transition",
        "event": "found",
        "by": "found",
        "from": "inspect.survey",
        "to": "inspect.leading",
    },
    {"t": 85.0, "kind": "event", "event": "wind_high", "state": "inspect.leading", "led_to": "ignored"},
    {"t": 110.0, "kind": "transition", "event": "tip_detected", "from": "inspect.leading", "to": "inspect.trailing"},
    {"t": 110.0, "kind": "memory", "tip_station_m": 39.8, "root_station_m": None},
    {"t": 160.0, "kind": "transition", "event": "root_detected", "from": "inspect.trailing", "to": "return_home"},
    {"t": 160.0, "kind": "memory", "tip_station_m": 39.8, "root_station_m": 1.2},
    {"t": 200.0, "kind": "transition", "event": "landed", "from": "return_home", "to": "completed"},
    {"t": 200.0, "kind": "end", "outcome": "completed", "state": "completed"},
)


def telemetry(north: float, down: float, mode: str = "OFFBOARD") -> Telemetry:
    """A vehicle that reports plausible things."""
    pose = VehiclePose(0.0, np.array([north, 0.0, down]), np.zeros(3), np.zeros(3), np.zeros(2))
    return Telemetry(pose, True, 0.05, True, True, mode, True, 81.0, np.array([3.0, 1.0]), 3.1, 0.1, None, 0.4)


def estimate(stamp_s: float, station_m: float, distance_m: float) -> BladeEstimate:
    """A vertical blade, its leading edge 60 px right of the image centre and its trailing edge as far left."""
    leading = SideEstimate(0.3, 0.0, 0.01, 0.001, 0.0, Line(0.0, 60.0), np.array([1.0, 0.0]))
    trailing = SideEstimate(-0.3, 0.0, 0.01, 0.001, 0.0, Line(np.pi, 60.0), np.array([-1.0, 0.0]))
    return BladeEstimate(
        stamp_s=stamp_s, age_s=0.0, station_m=station_m, distance_m=distance_m, distance_sigma_m=0.03,
        nearest_m=distance_m - 0.05, normal=np.zeros(3), point=np.zeros(3), depth_m=0.0, depth_slope=0.0,
        across_slope=0.0, leading=leading, trailing=trailing, heading=-np.pi / 2, heading_sigma=0.01, chord_m=0.6,
        chord_sigma_m=0.02, state=np.zeros(6), covariance=np.eye(6),
    )  # fmt: skip


def images(stamp_s: float) -> StereoFrames:
    """Something to look at, with the pose of a camera that looks ahead."""
    picture = np.full((512, 612, 3), 180, np.uint8)
    picture[:, 246:366] = 230
    return StereoFrames(stamp_s, picture, None, picture, None, CameraPose(np.zeros(3), np.eye(3)))


def fly(
    folder: RunFolder,
    until_s: float = 160.0,
    distance_m: float = 3.1,
    skip: tuple[float, float] = (0, 0),
    from_s: float = 60.0,
) -> None:
    """Record the two passes, five cycles a second, `distance_m` away; no station within `skip` is ever accepted."""
    log = RunLog(folder.log)
    recorder = RunRecorder(folder, CAMERA, log.logger, inline=True)
    log.logger.info("run_started")
    seen = BladeObservation(0.0, True, distance_m=distance_m, distance_sigma_m=0.03, nearest_m=3.0, sharpness=0.8)
    refused = BladeObservation(0.0, False, reasons=("too few dots",), sharpness=0.8)
    for step in range(round((until_s - from_s) * 5)):
        now = from_s + step / 5
        side, along = ("leading", (now - 60.0) / 50.0) if now < 110.0 else ("trailing", 1.0 - (now - 110.0) / 50.0)
        station = ROOT_M + along * (TIP_M - ROOT_M)
        believed = estimate(now, station, distance_m)
        accepted = not skip[0] <= station <= skip[1]
        update = UpdateResult(accepted, nis=1.0, dof=2)
        recorder.cycle(images(now), seen if accepted else refused, update, believed, side)
        recorder.telemetry.record(now, telemetry(40.0, -60.0), Setpoint(np.array([40.0, 0.0, -60.0]), 0.0))
        recorder.setpoints.record(step * 0.04, now, first=step == 0)
    log.logger.info("run_ended")
    recorder.close()
    log.close()


def write_journal(folder: RunFolder, until_s: float = 1e9, goes_on_in: str | None = None) -> None:
    """The journal of a completed flight, or its beginning; or what follows after `until_s`, going on in a state."""
    keyed = [line | ({"key": f"{line['from']}:{line['event']}"} if "from" in line else {}) for line in JOURNAL]
    lines = [line for line in keyed if line["t"] <= until_s]
    if goes_on_in is not None:
        begins = {**JOURNAL[0], "t": until_s, "resumed": True, "state": goes_on_in}
        lines = [begins, *(line for line in keyed if line["t"] > until_s)]
    folder.journal.write_text("".join(json.dumps({"seq": i, **line}) + "\n" for i, line in enumerate(lines)), "utf-8")


def flown(logs: Path, **options: object) -> RunFolder:
    """A complete, completed run."""
    folder = create(logs, "v80_blade", MISSION)
    fly(folder, **options)  # type: ignore[arg-type]
    write_journal(folder)
    return folder
