"""What the truth needs of a run's folder: the simulated vehicle's log, the passes, the photographs, the world.

The vehicle's log runs on the vehicle's own clock. It also holds the position that the autopilot reported, and so does
the mission's telemetry on the executive's clock: laid over each other they tell the difference of the two clocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from devices.blades_in_turn import BladesInTurn
from devices.recorded_mission import states_of
from devices.torn_files import csv_rows, json_lines
from devices.world.settings import WorldSettings
from devices.world.truth import SHARP, Flight, Pass, Photograph
from devices.world.turbine import TurbineShape
from vision.camera import Camera

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RunFiles:
    """One run as `flight_truth` wants it."""

    flight: Flight
    shape: TurbineShape
    camera: Camera
    mount: Array
    passes: tuple[Pass, ...]
    photographs: tuple[Photograph, ...]
    target_m: float | None
    tip_radius_m: float | None

    def later(self, seconds: float) -> RunFiles:
        """The same run so much later."""
        return replace(
            self,
            flight=replace(self.flight, t=self.flight.t + seconds),
            passes=tuple(Pass(one.start_s + seconds, one.end_s + seconds, one.side) for one in self.passes),
            photographs=tuple(replace(one, stamp_s=one.stamp_s + seconds) for one in self.photographs),
        )

    @classmethod
    def read(cls, folder: Path) -> RunFiles | None:
        """Read a run's folder; None where no simulated vehicle left its log or the mission names no turbine."""
        try:
            document = yaml.load((folder / "mission.yaml").read_text("utf-8"), Loader=yaml.CSafeLoader)
        except (OSError, yaml.YAMLError):
            return None
        rows = csv_rows(folder / "telemetry" / "truth.csv")
        if len(rows) < 2 or not isinstance(document, dict) or "turbine" not in document or "rig" not in document:
            return None
        settings = WorldSettings.model_validate(document.get("world") or {})
        shape = TurbineShape.of(document["turbine"], document["site"], settings.survey_error)
        reported = csv_rows(folder / "telemetry" / "telemetry.csv")
        flight = _flight(rows, _clock_offset(rows, reported))
        follows = {
            path: state.get("with") or {} for path, state in states_of(document) if state.get("do") == "follow_edge"
        }
        journal = list(json_lines(folder / "journal.jsonl"))
        turns = BladesInTurn.of(journal)
        wanted = [state.get("standoff_m") for state in follows.values()]
        standoff = [float(value) for value in wanted if isinstance(value, int | float)]
        return cls(
            flight,
            shape,
            _camera(document["rig"]),
            np.array(document["rig"].get("mount_m", (0.0, 0.0, 0.0)), float),
            tuple(_passes(journal, follows, _flown_until(flight, reported))),
            tuple(
                Photograph(float(line["stamp_s"]), str(line["side"]), turns.at(float(line["stamp_s"])))
                for line in json_lines(folder / "frames" / "frames.jsonl")
                if line.get("accepted") and (line.get("sharpness") or 0.0) >= SHARP
            ),
            standoff[0] if standoff else None,
            _claimed_tip(journal),
        )


def joined(runs: Sequence[RunFiles]) -> RunFiles | None:
    """Runs that go on with one another as one. Each is laid after the end of the one before, on a clock of their own:
    a vehicle that outlived its program was recorded while the next had not yet begun."""
    if not runs:
        return None
    parts, end_s = [], -np.inf
    for run in runs:
        parts.append(run.later(max(0.0, end_s + 1.0 - float(run.flight.t[0]))))
        end_s = float(parts[-1].flight.t[-1])
    flights = [part.flight for part in parts]
    flight = Flight(*(np.concatenate([getattr(one, f.name) for one in flights]) for f in fields(Flight)))
    tips = [part.tip_radius_m for part in parts if part.tip_radius_m is not None]
    return replace(
        parts[-1],
        flight=flight,
        passes=tuple(one for part in parts for one in part.passes),
        photographs=tuple(one for part in parts for one in part.photographs),
        tip_radius_m=tips[-1] if tips else None,
    )


def _claimed_tip(journal: list[Mapping[str, Any]]) -> float | None:
    """The tip's distance from the hub as last remembered, on a line of its own or beside a transition."""
    remembered = (line.get("memory") or line for line in reversed(journal))
    return next((float(one["tip_station_m"]) for one in remembered if one.get("tip_station_m") is not None), None)


def _columns(rows: list[Mapping[str, str]], *names: str) -> Array:
    return np.array([[float(row[name] or "nan") for name in names] for row in rows]).reshape(-1, len(names))


def _flight(rows: list[Mapping[str, str]], offset_s: float) -> Flight:
    return Flight(
        _columns(rows, "t")[:, 0] - offset_s,
        _columns(rows, "n", "e", "d"),
        _columns(rows, "roll", "pitch", "yaw"),
        _columns(rows, "gimbal_yaw", "gimbal_pitch"),
        np.array([row["armed"] in ("1", "True", "true") for row in rows]),
    )


def _clock_offset(rows: list[Mapping[str, str]], reported: list[Mapping[str, str]]) -> float:
    """Seconds that the vehicle's clock is ahead of the executive's: where the reported positions agree best."""
    if len(reported) < 20 or "estimated_n" not in rows[0]:
        return 0.0
    own = _columns(rows, "t", "estimated_n", "estimated_e", "estimated_d")
    told = _columns(reported, "t", "north", "east", "down")
    told = told[np.isfinite(told).all(axis=1)]
    if len(told) < 20 or np.ptp(told[:, 1:], axis=0).max() < 2.0:
        return 0.0

    def misfit(offset: float) -> float:
        at = told[:, 0] + offset
        error = [np.interp(at, own[:, 0], own[:, axis]) - told[:, axis] for axis in (1, 2, 3)]
        return float(np.mean(np.minimum(np.square(error), 25.0)))

    best, step = 0.0, 16.0
    low, high = own[0, 0] - told[-1, 0], own[-1, 0] - told[0, 0]
    candidates = np.arange(low, high, 0.5)
    best = float(candidates[int(np.argmin([misfit(offset) for offset in candidates]))])
    step = 0.5
    while step > 0.002:
        best = min((best - step / 2, best, best + step / 2), key=misfit)
        step /= 2
    return best


def _flown_until(flight: Flight, reported: list[Mapping[str, str]]) -> float:
    """When the program was last there: its vehicle may have gone on without it."""
    end_s = float(flight.t[-1])
    return min(end_s, float(reported[-1]["t"])) if reported else end_s


def _passes(journal: list[Mapping[str, Any]], follows: Mapping[str, Any], end_s: float) -> Iterator[Pass]:
    """The stays in those states, as the journal tells them."""
    entered: tuple[float, str] | None = None
    for line in journal:
        if line.get("kind") not in ("start", "transition"):
            continue
        now = float(line["t"])
        if entered is not None and entered[1] in follows:
            yield Pass(entered[0], now, str(follows[entered[1]].get("side", "")))
        entered = now, str(line.get("to") or line.get("state"))
    if entered is not None and entered[1] in follows:
        yield Pass(entered[0], end_s, str(follows[entered[1]].get("side", "")))


def _camera(rig: Mapping[str, Any]) -> Camera:
    section = rig["camera"]
    width, height, focal = int(section["width"]), int(section["height"]), float(section["focal_px"])
    k1, k2, p1, p2 = section.get("distortion") or (0.0, 0.0, 0.0, 0.0)
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, (k1, k2, p1, p2))
