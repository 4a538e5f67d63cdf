"""Kills the program at random instants of a flight beside a blade, and goes on with `--resume`."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from devices.vehicle.handover import note_in
from tests.campaign.verdict import Verdict, journal_of, judge, runs_in, state_of

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
PATIENCE_S = 300.0


@dataclass(frozen=True)
class Kill:
    """One sample. after_s: wall seconds of each program until it is killed, one or two. power: the vehicle's process is
    killed too. dead_s: until the next program. torn: bytes that the journal's last line loses."""

    after_s: tuple[float, ...]
    power: bool = False
    dead_s: float = 1.0
    torn: int = 0


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
            verdict.states.append(state_of(logs))
            if kill.power:
                _end_vehicles(logs)
            _tear(logs, kill.torn)
            time.sleep(kill.dead_s)
            options = ["--resume", "latest"] if runs_in(logs) else begin
        if not _ended(logs):
            code = _killed(command(logs, *options), PATIENCE_S, logs)
            verdict.missed += [] if code in (0, 1) else [f"exit {code}"]
        judge(logs, verdict)
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


def _ended(logs: Path) -> bool:
    runs = runs_in(logs)
    return bool(runs) and any(line["kind"] == "end" for line in journal_of(runs[-1]))


def _end_vehicles(logs: Path) -> None:
    for run in runs_in(logs):
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
    runs = runs_in(logs)
    path = runs[-1] / "journal.jsonl" if runs else None
    if not torn or path is None or not path.exists():
        return
    content = path.read_bytes()
    last = content[:-1].rfind(b"\n") + 1
    if b'"kind": "transition"' not in content[last:] and last:
        path.write_bytes(content[: max(last, len(content) - torn)])


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
