"""A run as its files tell it, read back: whole lines only, whatever happened to the program that wrote them. A run that
goes on with others is told together with them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from devices.blades_in_turn import BladesInTurn
from devices.recorded_mission import states_of
from devices.torn_files import csv_rows, json_lines
from mission.record.folder import RunFolder
from mission.record.lineage import lineage, reference

Line = Mapping[str, Any]
INTERRUPTED = "interrupted"
"""By what a state was left in which the program was cut off, and another began."""


def _is_time(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


@dataclass(frozen=True)
class Visit:
    """One stay in a state. left_s and by are None for the one in which the record ends."""

    state: str
    entered_s: float
    left_s: float | None = None
    by: str | None = None


@dataclass(frozen=True)
class RunHistory:
    """One run's files, after those of the runs that it goes on with. Each is read once, when it is first asked for; a
    missing file reads as an empty one."""

    folder: RunFolder

    @cached_property
    def parts(self) -> Sequence[RunFolder]:
        """The folders of all these runs, oldest first, this one's last."""
        return lineage(self.folder)

    @cached_property
    def journals(self) -> Sequence[Sequence[Line]]:
        """Every event, transition and memory of each part."""
        return [
            [line for line in json_lines(part.journal) if {"seq", "t", "kind"} <= line.keys() and _is_time(line["t"])]
            for part in self.parts
        ]

    @cached_property
    def mission(self) -> Line:
        """The resolved mission document."""
        try:
            document = yaml.load(self.folder.mission.read_text("utf-8"), Loader=yaml.CSafeLoader)
        except (OSError, ValueError, RecursionError, yaml.YAMLError):
            return {}
        return document if isinstance(document, dict) else {}

    @cached_property
    def journal(self) -> Sequence[Line]:
        """Every event, transition and memory."""
        return [line for journal in self.journals for line in journal]

    @cached_property
    def cycles(self) -> Sequence[Line]:
        """Every cycle of vision."""
        return [line for part in self.parts for line in json_lines(part.telemetry / "vision.jsonl")]

    @cached_property
    def frames(self) -> Sequence[Line]:
        """Every recorded photograph whose file is there; `path` is where, seen from this folder; and its `blade`."""
        return [
            {**line, "path": _path(part, self.folder, str(line["file"])), "blade": turn.at(line.get("stamp_s") or 0.0)}
            for part, turn in zip(self.parts, self.turns, strict=True)
            for line in json_lines(part.frames / "frames.jsonl")
            if "file" in line and "side" in line
        ]

    @cached_property
    def turns(self) -> Sequence[BladesInTurn]:
        """Which blade it was when, for each part."""
        turns: list[BladesInTurn] = []
        for journal in self.journals:
            turns.append(BladesInTurn.of(journal, turns[-1].last if turns else 0))
        return turns

    @cached_property
    def telemetry(self) -> Sequence[Mapping[str, str]]:
        """Rows of telemetry.csv."""
        return [row for part in self.parts for row in _telemetry(part)]

    @cached_property
    def setpoints(self) -> Sequence[Mapping[str, str]]:
        """Rows of setpoints.csv; the first of a program is the first of a stream."""
        found: list[Mapping[str, str]] = []
        for part in self.parts:
            rows = csv_rows(part.telemetry / "setpoints.csv")
            found += [{**row, "first": "1"} if number == 0 else row for number, row in enumerate(rows)]
        return found

    @cached_property
    def visits(self) -> Sequence[Visit]:
        """The states that the run was in, in order."""
        visits: list[Visit] = []
        for line in self.journal:
            entered = _entered(line)
            if entered is None:
                continue
            if visits:
                last = visits[-1]
                by = line.get("event") if line["kind"] == "transition" else INTERRUPTED
                visits[-1] = Visit(last.state, last.entered_s, line["t"], by)
            visits.append(Visit(entered, line["t"]))
        return visits

    @cached_property
    def end(self) -> Line | None:
        """The journal's last word; None for a run that was killed."""
        return next((line for line in reversed(self.journals[-1]) if line["kind"] == "end"), None)

    @cached_property
    def memory(self) -> Line:
        """What the behaviours had found out, as last journalled."""
        found: dict[str, Any] = {}
        for line in self.journal:
            found.update(line if line["kind"] == "memory" else line.get("memory", {}))
        return found

    @property
    def simulated(self) -> bool:
        """Whether no real vehicle flew."""
        kind = (self.mission.get("rig") or {}).get("kind")
        return kind != "hardware"

    @property
    def duration_s(self) -> float:
        """Mission seconds from the first line of the journal to the last of anything, of each part and in all."""
        return sum(_duration_s(part, journal) for part, journal in zip(self.parts, self.journals, strict=True))

    @property
    def wall_s(self) -> float | None:
        """Wall seconds from the first line of the run log, written with the folder, to the last."""
        spans = [span for part in self.parts if (span := _wall_s(part)) is not None]
        return sum(spans) if spans else None

    def parameters_of(self, behaviour: str) -> Mapping[str, Any]:
        """`with` of the first state that runs this behaviour."""
        for _, state in states_of(self.mission):
            if state.get("do") == behaviour:
                given = state.get("with")
                return given if isinstance(given, dict) else {}
        return {}


def _telemetry(part: RunFolder) -> Sequence[Mapping[str, str]]:
    return csv_rows(part.telemetry / "telemetry.csv")


def _duration_s(part: RunFolder, journal: Sequence[Line]) -> float:
    times = [line["t"] for line in (*journal[:1], *journal[-1:])]
    rows = [] if any(line["kind"] == "end" for line in journal) else _telemetry(part)
    if rows:
        times.append(float(rows[-1]["t"]))
    return max(times) - min(times) if times else 0.0


def _wall_s(part: RunFolder) -> float | None:
    stamps = [line["timestamp"] for line in json_lines(part.log) if "timestamp" in line]
    if len(stamps) < 2:
        return None
    return (datetime.fromisoformat(stamps[-1]) - datetime.fromisoformat(stamps[0])).total_seconds()


def _path(part: RunFolder, seen_from: RunFolder, file: str) -> str:
    """Of a photograph, relative to a run's folder where both lie side by side."""
    name = Path(file).name
    if part.path.resolve() == seen_from.path.resolve():
        return f"frames/{name}"
    to = reference(part, seen_from)
    return f"{to if Path(to).is_absolute() else f'../{to}'}/frames/{name}"


def _entered(line: Line) -> str | None:
    """The leaf that a line of the journal says was entered."""
    if line["kind"] not in ("start", "transition"):
        return None
    return str(line["to"] if line["kind"] == "transition" else line["state"])
