"""A run as its files tell it, read back: whole lines only, whatever happened to the program that wrote them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from typing import Any

import yaml

from devices.torn_files import csv_rows, json_lines
from mission.record.folder import RunFolder

Line = Mapping[str, Any]


@dataclass(frozen=True)
class Visit:
    """One stay in a state. left_s and by are None for the one in which the record ends."""

    state: str
    entered_s: float
    left_s: float | None = None
    by: str | None = None


@dataclass(frozen=True)
class RunHistory:
    """One run's files. Each is read once, when it is first asked for; a missing file reads as an empty one."""

    folder: RunFolder

    @cached_property
    def mission(self) -> Line:
        """The resolved mission document."""
        try:
            document = yaml.load(self.folder.mission.read_text("utf-8"), Loader=yaml.CSafeLoader)
        except (OSError, yaml.YAMLError):
            return {}
        return document if isinstance(document, dict) else {}

    @cached_property
    def journal(self) -> Sequence[Line]:
        """Every event, transition and memory."""
        return [line for line in json_lines(self.folder.journal) if {"seq", "t", "kind"} <= line.keys()]

    @cached_property
    def log(self) -> Sequence[Line]:
        """The run log."""
        return list(json_lines(self.folder.log))

    @cached_property
    def cycles(self) -> Sequence[Line]:
        """Every cycle of vision."""
        return list(json_lines(self.folder.telemetry / "vision.jsonl"))

    @cached_property
    def frames(self) -> Sequence[Line]:
        """Every recorded photograph whose file is there."""
        return [line for line in json_lines(self.folder.frames / "frames.jsonl") if "file" in line and "side" in line]

    @cached_property
    def telemetry(self) -> Sequence[Mapping[str, str]]:
        """Rows of telemetry.csv."""
        return csv_rows(self.folder.telemetry / "telemetry.csv")

    @cached_property
    def setpoints(self) -> Sequence[Mapping[str, str]]:
        """Rows of setpoints.csv."""
        return csv_rows(self.folder.telemetry / "setpoints.csv")

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
                visits[-1] = Visit(last.state, last.entered_s, line["t"], line.get("event"))
            visits.append(Visit(entered, line["t"]))
        return visits

    @cached_property
    def end(self) -> Line | None:
        """The journal's last word; None for a run that was killed."""
        return next((line for line in reversed(self.journal) if line["kind"] == "end"), None)

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
        """Mission seconds from the first line of the journal to the last of anything."""
        times = [line["t"] for line in (*self.journal[:1], *self.journal[-1:])]
        if self.end is None and self.telemetry:
            times.append(float(self.telemetry[-1]["t"]))
        return max(times) - min(times) if times else 0.0

    @property
    def wall_s(self) -> float | None:
        """Wall seconds from the first line of the run log, written with the folder, to the last."""
        stamps = [line["timestamp"] for line in self.log if "timestamp" in line]
        if len(stamps) < 2:
            return None
        first, last = datetime.fromisoformat(stamps[0]), datetime.fromisoformat(stamps[-1])
        return (last - first).total_seconds()

    def parameters_of(self, behaviour: str) -> Mapping[str, Any]:
        """`with` of the first state that runs this behaviour."""
        for state in _states(self.mission.get("states") or {}):
            if state.get("do") == behaviour:
                given = state.get("with")
                return given if isinstance(given, dict) else {}
        return {}


def _entered(line: Line) -> str | None:
    """The leaf that a line of the journal says was entered."""
    if line["kind"] not in ("start", "transition"):
        return None
    return str(line["to"] if line["kind"] == "transition" else line["state"])


def _states(states: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    for state in states.values():
        if isinstance(state, dict):
            yield state
            yield from _states(state.get("states") or {})
