"""Every code has a page; its wrong example raises the code on the marked line, its right example raises nothing."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from mission.language.codes import CODES
from mission.language.diagnostics import Diagnostic
from mission.language.loading import examine
from mission.language.proof import prove
from mission.language.scenario_report import report
from tests.mission.language.missions import MISSIONS, ROOT

PAGES = ROOT / "docs" / "codes"
_BLOCK = re.compile(r"^(Wrong|Right):\n\n```(yaml|console)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def examples(code: str) -> dict[str, tuple[str, str]]:
    """`Wrong` and `Right` → language and text."""
    found = {title: (form, text) for title, form, text in _BLOCK.findall((PAGES / f"{code}.md").read_text())}
    assert found.keys() == {"Wrong", "Right"}, code
    return found


def raised(code: str, form: str, text: str, tmp_path: Path) -> list[tuple[str, int]]:
    """Codes and lines that an example raises."""
    missions = Path(shutil.copytree(MISSIONS, tmp_path / "missions"))
    if form == "console":
        _, _, file, *overrides = text.split("$ ")[1].replace("--set ", "").split()
        return lines_of(examine(tmp_path / file, overrides).diagnostics)
    path = missions / "example.yaml"
    path.write_text(text)
    if code.startswith("M4"):
        mission = examine(path, checked=False).mission
        assert mission is not None
        proof = prove(mission)
        wrong = [("M401", 0) for one in proof.events for _ in one.failures]
        return wrong + [("M402", 0) for one in proof.invariants if one.failure is not None]
    if code.startswith("M5"):
        return lines_of(report(path).findings)
    return lines_of(examine(path).diagnostics)


def lines_of(findings: tuple[Diagnostic, ...]) -> list[tuple[str, int]]:
    return [(finding.code, finding.location.line) for finding in findings]


def marked(code: str, text: str) -> int:
    """The line that the example marks, 0 where the finding has none."""
    lines = [number for number, line in enumerate(text.splitlines(), 1) if f"# <- {code}" in line]
    return lines[0] if lines else 0


@pytest.mark.parametrize("code", CODES)
def test_the_wrong_example_raises_its_code_where_it_is_marked(code: str, tmp_path: Path) -> None:
    form, text = examples(code)["Wrong"]
    assert (code, marked(code, text)) in raised(code, form, text, tmp_path)


@pytest.mark.parametrize("code", CODES)
def test_the_right_example_raises_nothing(code: str, tmp_path: Path) -> None:
    form, text = examples(code)["Right"]
    assert raised(code, form, text, tmp_path) == []


def test_there_is_a_page_for_every_code_and_no_other() -> None:
    pages = {path.stem for path in PAGES.glob("M*.md")}
    assert pages == set(CODES)
    index = (PAGES / "README.md").read_text()
    for code, entry in CODES.items():
        assert f"[{code}]({code}.md) | {entry.text} |" in index
        assert (PAGES / f"{code}.md").read_text().startswith(f"# {code}: {entry.text}\n")
        assert ("# allow:" in (PAGES / f"{code}.md").read_text().split("\n\n")[1]) == entry.allowed


def test_only_what_may_be_allowed_can_be_silenced(tmp_path: Path) -> None:
    missions = Path(shutil.copytree(MISSIONS, tmp_path / "missions"))
    text = "extends: square.yaml\nstates:\n  square: {on: {battery_low: aborted}}  # allow: M309, it will be fine\n"
    (missions / "example.yaml").write_text(text)
    assert lines_of(examine(missions / "example.yaml").diagnostics) == [("M108", 3), ("M309", 3)]


def test_the_mission_in_the_reference_is_a_sound_one(tmp_path: Path) -> None:
    blocks = re.findall(r"^```yaml\n(.*?)^```", (ROOT / "docs" / "language.md").read_text(), re.MULTILINE | re.DOTALL)
    missions = Path(shutil.copytree(MISSIONS, tmp_path / "missions"))
    (missions / "look_around.yaml").write_text(blocks[0])
    (missions / "scenarios" / "look_around.scenario.yaml").write_text(blocks[1].replace("coverage: complete", "#"))
    assert lines_of(examine(missions / "look_around.yaml").diagnostics) == []
    assert report(missions / "scenarios" / "look_around.scenario.yaml").findings == ()


def test_the_reference_names_every_key() -> None:
    from mission.language import mission_in, states_in, transitions_in

    text = (ROOT / "docs" / "language.md").read_text()
    for key in {**mission_in.FIELDS, **states_in.FIELDS, **transitions_in.FIELDS}:
        assert f"`{key}`" in text, key
