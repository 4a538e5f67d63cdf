"""Whatever is wrong with what a person gives to `mission run`: one clear line, the exit code, nothing half-written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.mission.cli.conftest import Call
from tests.mission.cli.program import ROOT, mission

BLADE = (ROOT / "missions" / "v80_blade.yaml").read_text()


def with_change(old: str, new: str) -> Callable[[Path], Path]:
    """The blade mission with one mistake in it, among the files that it includes."""

    def write(folder: Path) -> Path:
        for name in ("turbines", "rigs", "sites"):
            (folder / name).symlink_to(ROOT / "missions" / name)
        assert old in BLADE
        path = folder / "mission.yaml"
        path.write_text(BLADE.replace(old, new, 1))
        return path

    return write


MISTAKES = {
    "malformed YAML": (with_change("parameters:", "parameters: ["), "mission.yaml:"),
    "unknown key": (with_change("initial: preflight", "initail: preflight"), "initial"),
    "wrong type": (with_change("standoff_m: 3.0", "standoff_m: near"), "standoff_m"),
    "missing target": (with_change("to: reposition", "to: repositoin"), "reposition"),
    "unknown behaviour": (with_change("do: take_off", "do: take_of"), "take_off"),
    "parameter out of range": (with_change("height_m: 15", "height_m: -15"), "height_m"),
    "missing include": (with_change("turbines/v80.yaml", "turbines/v90.yaml"), "v90.yaml"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_the_file_is_reported_at_its_line(call: Call, tmp_path: Path, name: str) -> None:
    write, words = MISTAKES[name]
    said = call("run", write(tmp_path), "--record", tmp_path / "logs")
    assert said.code == 2
    first = said.err.splitlines()[0]
    assert first.startswith(f"{tmp_path / 'mission.yaml'}:") or "v90.yaml" in first
    assert words in said.err
    assert "Traceback" not in said.err
    assert "unexpected" not in said.err
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere.yaml"], "nowhere.yaml"),
        (["missions"], "missions"),
        (["/dev/null"], "/dev/null"),
        (["missions/v80_blade.yaml", "--rig", "nowhere.yaml"], "nowhere.yaml"),
        (["missions/v80_blade.yaml", "--set", "turbine.azimut_deg=3"], "azimuth_deg"),
        (["missions/v80_blade.yaml", "--set", "turbine.azimuth_deg"], "turbine.azimuth_deg"),
        (["missions/v80_blade.yaml", "--set", "limits.clearance_m=-1"], "clearance_m"),
        (["missions/v80_blade.yaml", "--set", "world.faults.nonsense=1"], "nonsense"),
        (["--resume", "nowhere"], "nowhere"),
        ([], "mission file"),
    ],
)
def test_a_wrong_argument_is_one_line_and_exit_code_2(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(ROOT)
    said = call("run", *arguments, "--record", tmp_path / "logs")
    said.assert_one_line(2)
    assert words in said.err
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize("logs", ["/proc/logs", "/dev/null/logs"])
def test_a_place_that_cannot_be_written_is_one_line_and_exit_code_2(call: Call, logs: str) -> None:
    said = call("run", ROOT / "missions" / "v80_blade.yaml", "--record", logs)
    said.assert_one_line(2)
    assert "--record DIR" in said.err


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_one_line_and_exit_code_2(call: Call, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    said = call("run", ROOT / "missions" / "v80_blade.yaml", "--record", tmp_path)
    said.assert_one_line(2)
    assert "read-only" in said.err


def test_a_mistake_is_worded_alike_in_a_process_of_its_own(tmp_path: Path) -> None:
    """Without a display, a terminal or a home."""
    bare = {"DISPLAY": "", "TERM": "dumb", "HOME": "/nonexistent", "LC_ALL": "C"}
    said = mission("run", ROOT / "missions" / "v80_blade.yaml", "--set", "turbine.azimut_deg=3", cwd=tmp_path, env=bare)
    said.assert_one_line(2)
    assert list(tmp_path.iterdir()) == []
