"""Files that mean harm, or were torn on the way, are refused at once with one clear finding at its own line."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from mission.language.loading import examine
from tests.mission.language.missions import MISSIONS

SQUARE = (MISSIONS / "square.yaml").read_text()
STATES = "states:\n"


def _examined(tmp_path: Path, text: str) -> list[str]:
    for part in ("parts", "turbines", "rigs", "sites"):
        shutil.copytree(MISSIONS / part, tmp_path / part, dirs_exist_ok=True)
    path = tmp_path / "square.yaml"
    path.write_bytes(text.encode())
    return [f"{f.location.line} {f.code}" for f in examine(path).errors if f.location.file.endswith("square.yaml")]


def _doubling(first: str, form: str) -> str:
    """Parameters of which each holds the one before several times."""
    return "parameters: {p0: " + first + "".join(f", p{n}: {form.replace('P', f'${{p{n - 1}}}')}" for n in range(1, 30))


@pytest.mark.parametrize(
    ("mutation", "expected"),
    [
        (lambda text: text.replace(STATES, _doubling("[1, 1, 1]", '["P", "P", "P"]') + "}\n" + STATES, 1), "5 M006"),
        (lambda text: text.replace(STATES, _doubling("aaaa", '"PPPPPPPP"') + "}\n" + STATES, 1), "5 M006"),
        (lambda text: text.replace(STATES, _doubling('"${p29}"', '"P"') + "}\n" + STATES, 1), "5 M105"),
        (lambda text: text.replace("timeout_s: 60", "timeout_s: 074", 1), "11 M203"),
        (lambda text: text.replace("mission: square", "mission: sq\u2028uare"), "4 M007"),
        (lambda text: text.replace("mission: square", "mission: sq\u200fuare"), "4 M007"),
        (lambda text: text.replace("mission: square", 'mission: "square'), "4 M002"),
        (lambda text: text.replace("mission: square", "mission:square"), "4 M002"),
        (lambda text: text.replace("parts/flight.yaml", "../../etc/passwd"), "3 M103"),
        (lambda text: text.replace("extends: parts/flight.yaml", "extends: []"), "3 M203"),
    ],
)  # fmt: skip
def test_what_would_grow_mislead_or_climb_out_is_named_first(tmp_path: Path, mutation, expected: str) -> None:
    changed = mutation(SQUARE)
    assert changed != SQUARE
    assert _examined(tmp_path, changed)[0] == expected


@pytest.mark.parametrize("ending", ["\r\n", "\r"])
def test_other_line_endings_and_a_byte_order_mark_are_read_and_counted_alike(tmp_path: Path, ending: str) -> None:
    wrong = SQUARE.replace("arrived: east", "arrived: eest")
    assert "11 M212" in _examined(tmp_path, "\ufeff" + wrong.replace("\n", ending))


def test_a_file_that_is_missing_below_is_the_only_finding(tmp_path: Path) -> None:
    assert _examined(tmp_path, SQUARE.replace("parts/flight.yaml", "parts/fligth.yaml")) == ["3 M101"]


def test_a_state_that_is_no_mapping_is_found_below_another_file(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text("extends: parts/flight.yaml\nstates:\n  launch: true\n")
    _examined(tmp_path, SQUARE.replace("parts/flight.yaml", "base.yaml"))
    places = [(Path(f.location.file).name, f.location.line) for f in examine(tmp_path / "square.yaml").errors]
    assert ("base.yaml", 3) in places


def test_a_parameter_of_the_autopilot_is_held_to_its_names(tmp_path: Path) -> None:
    rig = "mission: square\nrig: {extends: rigs/simulated.yaml, parameters: {COM_OF_LOS_T: 1}}"
    assert _examined(tmp_path, SQUARE.replace("mission: square", rig)) == ["5 M205"]


def test_pipes_devices_and_folders_are_no_missions(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    for path in (tmp_path / "pipe.yaml", tmp_path, Path("/dev/zero")):
        assert [finding.code for finding in examine(path).errors] == ["M001"]
