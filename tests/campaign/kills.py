"""Kills the program at random instants of a flight beside a blade, goes on with `--resume`, and judges what became of
the inspection by its journals, its photographs and the truth."""

from __future__ import annotations

import asyncio
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from devices.torn_files import csv_rows, json_lines
from devices.vehicle.handover import note_in
from mission.executive.journal import JournalError, read_journal
from mission.executive.replay import replay
from mission.language.document import load

ROOT = Path(__file__).parents[2]
SHORT_BLADE = """\
# The blade mission at a blade of nine metres near by: a flight of a minute, for campaigns of many.
extends: v80_blade.yaml
mission: short_blade
turbine: {extends: turbines/v80.yaml, blade_length_m: 9, max_chord_m: 1.7, root_diameter_m: 0.9, hub_height_m: 30}
site: {extends: sites/coast.yaml, turbine_north_m: 40}
states:
  inspect:
    states:
      survey: {with: {pictures: 1}}
"""
CLEARANCE_M = 2.0
AGAIN_M = 4.0  # of a pass that went on: its overlap, and the stretch that a picture shows
PATIENCE_S = 300.0


@dataclass(frozen=True)
class Kill:
    """One sample. after_s: wall seconds of each program until it is killed, one or two. power: the vehicle's process is
    killed too. dead_s: until the next program. torn: bytes that the journal's last line loses."""

    after_s: tuple[float, ...]
    power: bool = False
    dead_s: float = 1.0
    torn: int = 0


@dataclass
class Verdict:
    """What became of it. states: where each program was killed. missed: what should not have happened."""

    outcome: str = ""
    states: list[str] = field(default_factory=list)
    clearance_m: float | None = None
    missed: list[str] = field(default_factory=list)


def drawn(number: int, seed: int, flight_s: float) -> Iterator[Kill]:
    """Samples, the same for one seed: instants uniform over a flight that lasts so many wall seconds."""
    dice = random.Random(seed)
    for _ in range(number):
        kind = dice.random()
        first = dice.uniform(0.0, flight_s)
        after = (first, dice.uniform(0.0, flight_s)) if kind < 0.2 else (first,)
        torn = dice.randrange(1, 80) if dice.random() < 0.3 else 0
        yield Kill(after, power=kind > 0.7, dead_s=dice.uniform(0.0, 12.0), torn=torn)


def short_blade(folder: Path) -> Path:
    """The mission file, beside copies of those that it is made from."""
    shutil.copytree(ROOT / "missions", folder, dirs_exist_ok=True)
    path = folder / "short_blade.yaml"
    path.write_text(SHORT_BLADE, "utf-8")
    return path


def command(logs: Path, *options: str) -> list[str]:
    """The command that a user types."""
    return [sys.executable, "-m", "mission", "run", *options, "--headless", "--record", str(logs)]


def fly(kill: Kill, mission: Path, logs: Path, *given: str) -> Verdict:
    """Fly, kill, go on, judge. The folders stay below `logs`. given: further options of the first command."""
    verdict = Verdict()
    shutil.rmtree(logs, ignore_errors=True)
    logs.mkdir(parents=True)
    options = begin = [str(mission), *given]
    try:
        for after_s in kill.after_s:
            if _killed(command(logs, *options), after_s, logs) is not None:
                break
            verdict.states.append(_state(logs))
            if kill.power:
                _end_vehicles(logs)
            _tear(logs, kill.torn)
            time.sleep(kill.dead_s)
            options = ["--resume", "latest"] if _runs(logs) else begin
        if not _ended(logs):
            code = _killed(command(logs, *options), PATIENCE_S, logs)
            verdict.missed += [] if code in (0, 1) else [f"exit {code}"]
        _judge(logs, verdict)
    finally:
        _end_vehicles(logs)
    return verdict


def _killed(words: list[str], after_s: float, logs: Path) -> int | None:
    """Exit code of a program that ended by itself; None for one that had to be killed."""
    with (logs / "output.txt").open("a") as output:
        process = subprocess.Popen(words, cwd=ROOT, stdout=output, stderr=subprocess.STDOUT, start_new_session=True)
    try:
        return process.wait(after_s)
    except subprocess.TimeoutExpired:
        return None
    finally:
        process.kill()
        process.wait()


def _runs(logs: Path) -> list[Path]:
    return sorted(path.parent for path in logs.glob("*/mission.yaml"))


def _journal(run: Path) -> list[Mapping[str, Any]]:
    return list(json_lines(run / "journal.jsonl"))


def _state(logs: Path) -> str:
    """The last settled state of all runs."""
    for run in reversed(_runs(logs)):
        entered = [
            line.get("to") or line.get("state") for line in _journal(run) if line["kind"] in ("start", "transition")
        ]
        if entered:
            return str(entered[-1])
    return "-"


def _ended(logs: Path) -> bool:
    runs = _runs(logs)
    return bool(runs) and any(line["kind"] == "end" for line in _journal(runs[-1]))


def _end_vehicles(logs: Path) -> None:
    for run in _runs(logs):
        note = note_in(run)
        if note is not None and b"devices.vehicle" in _command_line(note.pid):
            with suppress(ProcessLookupError):
                os.kill(note.pid, signal.SIGKILL)


def _command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def _tear(logs: Path, torn: int) -> None:
    """As a power failure may leave the last line, which had not yet taken effect."""
    runs = _runs(logs)
    path = runs[-1] / "journal.jsonl" if runs else None
    if not torn or path is None or not path.exists():
        return
    content = path.read_bytes()
    last = content[:-1].rfind(b"\n") + 1
    if b'"kind": "transition"' not in content[last:] and last:
        path.write_bytes(content[: max(last, len(content) - torn)])


def _judge(logs: Path, verdict: Verdict) -> None:
    from mission.cli.report import rebuild
    from mission.record.folder import RunFolder

    text = (logs / "output.txt").read_text()
    if "Traceback" in text or "unexpected error" in text:
        verdict.missed.append("a traceback")
    runs = _runs(logs)
    last = runs[-1]
    ends = [line for line in _journal(last) if line["kind"] == "end"]
    verdict.outcome = str(ends[-1]["outcome"]) if ends else "unfinished"
    if verdict.outcome not in ("completed", "aborted"):
        verdict.missed.append(f"{verdict.outcome} in {_state(logs)}")
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
        for line in _journal(run):
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


def campaign(number: int, seed: int, flight_s: float, record: Path, *given: str) -> int:
    """Fly them all; print a line each; return how many missed something."""
    missed = 0
    outcomes: dict[str, int] = {}
    mission = short_blade(record / "missions")
    for index, kill in enumerate(drawn(number, seed, flight_s)):
        began = time.monotonic()
        verdict = fly(kill, mission, record / f"{seed}-{index:03d}", *given)
        missed += bool(verdict.missed)
        outcomes[verdict.outcome] = outcomes.get(verdict.outcome, 0) + 1
        how = (
            f"{' '.join(f'{s:.1f}' for s in kill.after_s)} s{', power' if kill.power else ''}, dead {kill.dead_s:.1f} s"
        )
        clearance = "-" if verdict.clearance_m is None else f"{verdict.clearance_m:.2f}"
        print(
            f"{index:3d}  {how:<34}{' | '.join(verdict.states) or 'not killed':<52}{verdict.outcome:<11}{clearance:>6}"
            f"{time.monotonic() - began:6.0f}  {'; '.join(verdict.missed) or 'nothing'}",
            flush=True,
        )
    print(json.dumps({"samples": number, "missed": missed, **outcomes}))
    return missed
