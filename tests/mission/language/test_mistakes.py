"""A mistake on any line of the shipped files is reported on that line, never with a traceback; they have none."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from mission.language.loading import examine
from tests.mission.language.missions import MISSIONS, line_of
from tests.mission.language.mistakes import Mistake, mistakes

SHIPPED = sorted(MISSIONS.glob("*.yaml"))
STRIDE = 9  # every ninth of several thousand, other ones in each file


def _copy(tmp_path: Path) -> Path:
    return Path(shutil.copytree(MISSIONS, tmp_path / "missions"))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_missions_raise_no_false_alarm(path: Path) -> None:
    assert [str(finding) for finding in examine(path).diagnostics] == []


def test_mistakes_are_reported_on_their_own_line(tmp_path: Path) -> None:
    missions = _copy(tmp_path)
    made, missed = 0, []
    for path in sorted(missions.rglob("*.yaml")):
        original = path.read_text()
        if path.parent.name == "scenarios":
            continue
        reader = path if path.parent == missions else _user_of(path, missions)
        rig = str(path) if reader is None else None
        for mistake in list(mistakes(path))[made % STRIDE :: STRIDE]:
            path.write_text(mistake.text)
            made += 1
            if not _reported(mistake, reader or missions / "v80_blade.yaml", rig):
                missed.append(f"{mistake.kind}: {path.name}:{mistake.lines[0]} {mistake.what}")
        path.write_text(original)
    assert made >= 300
    assert len(missed) <= 0.02 * made, missed


def _user_of(part: Path, missions: Path) -> Path | None:
    """A mission that uses a file; None for a rig that is chosen with --rig."""
    name = str(part.relative_to(missions))
    return next((path for path in sorted(missions.glob("*.yaml")) if name in path.read_text()), None)


def _reported(mistake: Mistake, reader: Path, rig: str | None) -> bool:
    examination = examine(reader, rig=rig)
    places = [(Path(finding.location.file).name, finding.location.line) for finding in examination.diagnostics]
    return bool(examination.errors) and any((mistake.file.name, line) in places for line in mistake.lines)


@pytest.mark.parametrize(
    ("before", "after", "code", "line"),
    [
        ("  pilot_took_over: released", "  resumed: released", "M307", "on:\n  res"),
        ("      abort: abort              #", "      #", "M307", "  inspect:"),
        ("do: survey_turbine\n        timeout_s: 240", "do: survey_turbine", "M306", "      survey:"),
        ("do: back_off, timeout_s: 30, ", "do: back_off, ", "M306", "do: back_off, on: {done: climb"),
        ("tip_detected: confirm_tip, ", "", "M303", "      leading:"),
        ("edge_lost: {to: search_leading, retries: 3}", "edge_lost: search_leading", "M305", "found: leading, not_f"),
        ("240, on: {done: land}}", "240, on: {done: completed}}", "M309", "on: {done: completed}"),
    ],
)  # fmt: skip
def test_mistakes_of_the_whole_machine_are_reported_where_it_is_wrong(
    tmp_path: Path, before: str, after: str, code: str, line: str
) -> None:
    path = _copy(tmp_path) / "v80_blade.yaml"
    text = path.read_text()
    assert text.count(before) == 1, before
    changed = text.replace(before, after)
    path.write_text(changed)
    found = [finding for finding in examine(path).errors if finding.code == code]
    assert found, [str(finding) for finding in examine(path).diagnostics]
    number = changed[: changed.index(line)].count("\n") + 1
    assert number in [finding.location.line for finding in found], [str(one) for one in found]


def test_files_that_include_each_other_or_do_not_exist_are_reported_where_they_are_named(tmp_path: Path) -> None:
    missions = _copy(tmp_path)
    path = missions / "v80_blade.yaml"
    text = path.read_text()
    for wrong in (
        "turbines/v81.yaml",
        "v80_blade.yaml",
        "turbines",
        "../missions.yaml",
        "https://example.org/v80.yaml",
    ):
        path.write_text(text.replace("turbines/v80.yaml", wrong))
        lines = [finding.location.line for finding in examine(path).errors]
        assert line_of(text, "turbine:") in lines, wrong
