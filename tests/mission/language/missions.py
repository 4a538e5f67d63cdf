"""Writes small missions for the tests of the language."""

from __future__ import annotations

from pathlib import Path

from mission.language.diagnostics import Diagnostic
from mission.language.loading import Examination, examine

ROOT = Path(__file__).parents[3]
MISSIONS = ROOT / "missions"

PREAMBLE = """\
mission: small
version: 1
turbine: turbines/v80.yaml
rig: rigs/simulated.yaml
site: sites/coast.yaml
"""

STATES = """\
initial: preflight
on: {pilot_took_over: released}
states:
  preflight: {do: check_vehicle, timeout_s: 60, on: {passed: launch, failed: refused, abort: refused}}
  launch: {do: take_off, timeout_s: 60, on: {done: work, failed: land, abort: land}}
  work: {do: hold, with: {for_s: 5}, timeout_s: 60, on: {done: home, abort: land}}
  home: {do: go_home, timeout_s: 60, on: {done: finish, failed: land, abort: land}}
  finish: {do: land, timeout_s: 60, on: {landed: completed, abort: land}}
  land: {do: land, timeout_s: 60, on: {landed: aborted, failed: land}}  # allow: M305, it is asked to land until it has
  completed: {final: true, outcome: completed}
  aborted: {final: true, outcome: aborted}
  refused: {final: true, outcome: refused}
  released: {final: true, outcome: released}
"""

SMALL = PREAMBLE + STATES


def folder(tmp_path: Path) -> Path:
    """A folder with the shipped turbine, rig and site files, for missions of a test's own."""
    missions = tmp_path / "missions"
    for part in ("turbines", "rigs", "sites"):
        (missions / part).mkdir(parents=True, exist_ok=True)
        for file in (MISSIONS / part).glob("*.yaml"):
            (missions / part / file.name).write_bytes(file.read_bytes())
    return missions


def written(tmp_path: Path, text: str, name: str = "small.yaml") -> Path:
    """A mission file with this text, beside the shipped turbine, rig and site."""
    path = folder(tmp_path) / name
    path.write_text(text)
    return path


def examined(tmp_path: Path, text: str, overrides: tuple[str, ...] = ()) -> Examination:
    """What reading the text as a mission gives."""
    return examine(written(tmp_path, text), overrides)


def only(examination: Examination) -> Diagnostic:
    """The single finding."""
    assert len(examination.diagnostics) == 1, [str(finding) for finding in examination.diagnostics]
    return examination.diagnostics[0]


def line_of(text: str, part: str) -> int:
    """The number of the line that contains a part; it must be the only one."""
    lines = [number for number, line in enumerate(text.splitlines(), 1) if part in line]
    assert len(lines) == 1, (part, lines)
    return lines[0]
