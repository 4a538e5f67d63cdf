"""What became of an inspection that was killed and gone on with, by its journals, its photographs and the truth."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from devices.torn_files import csv_rows, json_lines
from mission.executive.journal import JournalError, read_journal
from mission.executive.replay import replay
from mission.language.document import load

CLEARANCE_M = 2.0
AGAIN_M = 4.0  # of a pass that went on: its overlap, and the stretch that a picture shows


@dataclass
class Verdict:
    """What became of it. states: where each program was killed. missed: what should not have happened."""

    outcome: str = ""
    states: list[str] = field(default_factory=list)
    clearance_m: float | None = None
    missed: list[str] = field(default_factory=list)


def runs_in(logs: Path) -> list[Path]:
    """Folders of the runs, oldest first."""
    return sorted(path.parent for path in logs.glob("*/mission.yaml"))


def journal_of(run: Path) -> list[Mapping[str, Any]]:
    """Whole lines of a run's journal."""
    return list(json_lines(run / "journal.jsonl"))


def state_of(logs: Path) -> str:
    """The last settled state of all runs."""
    for run in reversed(runs_in(logs)):
        entered = [
            line.get("to") or line.get("state") for line in journal_of(run) if line["kind"] in ("start", "transition")
        ]
        if entered:
            return str(entered[-1])
    return "-"


def judge(logs: Path, verdict: Verdict) -> None:
    """Complete a verdict by what the runs below a folder left behind."""
    from mission.cli.report import rebuild
    from mission.record.folder import RunFolder

    text = (logs / "output.txt").read_text()
    if "Traceback" in text or "unexpected error" in text:
        verdict.missed.append("a traceback")
    runs = runs_in(logs)
    if not runs:
        verdict.missed.append("no run was begun")
        return
    last = runs[-1]
    ends = [line for line in journal_of(last) if line["kind"] == "end"]
    verdict.outcome = str(ends[-1]["outcome"]) if ends else "unfinished"
    if verdict.outcome not in ("completed", "aborted"):
        verdict.missed.append(f"{verdict.outcome} in {state_of(logs)}")
    for run in runs:
        verdict.missed += [f"{run.name}: {text}" for text in _unreadable(run)]
    rows = csv_rows(last / "telemetry" / "truth.csv")
    if rows and (rows[-1]["armed"] != "0" or abs(float(rows[-1]["d"])) > 1.0):
        verdict.missed.append(f"left at {-float(rows[-1]['d']):.1f} m, armed {rows[-1]['armed']}")
    verdict.missed += _flown_twice(runs)
    truth = rebuild(RunFolder(last)).get("truth") or {}
    verdict.clearance_m = truth.get("min_clearance_m")
    if verdict.clearance_m is not None and verdict.clearance_m < CLEARANCE_M:
        verdict.missed.append(f"clearance {verdict.clearance_m:.2f} m")


def _unreadable(run: Path) -> Iterator[str]:
    path = run / "journal.jsonl"
    if not path.exists():
        return
    try:
        read_journal(path)
        mission = load(run / "mission.yaml")
    except (JournalError, ValueError) as error:
        yield str(error)
        return

    async def differences() -> list[str]:
        return [str(played.difference) for played in [one async for one in replay(path, mission)] if played.difference]

    yield from asyncio.run(differences())


def _flown_twice(runs: Sequence[Path]) -> Iterator[str]:
    """Passes that were entered after they had been journalled as done, and photographs taken of the same stretch by
    two programs beyond the overlap."""
    done: set[str] = set()
    for run in runs:
        for line in journal_of(run):
            state = line.get("to") if line["kind"] == "transition" else line.get("state")
            if line["kind"] in ("transition", "start"):
                side = str(state).rpartition(".")[2]
                if side in done:
                    yield f"{side} flown again after it was done"
            memory = line.get("memory") or (line if line["kind"] == "memory" else {})
            done = set(memory.get("passes_done", done))
    stretches: dict[str, list[tuple[float, float]]] = {}
    for run in runs:
        for side in ("leading", "trailing"):
            at = [
                float(line["station_m"])
                for line in json_lines(run / "frames" / "frames.jsonl")
                if line.get("side") == side and line.get("station_m") is not None
            ]
            if at:
                stretches.setdefault(side, []).append((min(at), max(at)))
    for side, found in stretches.items():
        for (low, high), (other_low, other_high) in pairwise(found):
            again = min(high, other_high) - max(low, other_low)
            if again > AGAIN_M:
                yield f"{again:.1f} m of {side} twice"
