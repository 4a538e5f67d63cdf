"""The program itself: its help, its table of commands, what it imports, and how it words an error."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from mission.cli import errors
from mission.cli import main as program
from mission.cli.main import GROUPS, commands, load
from tests.mission.cli.conftest import Call
from tests.mission.cli.program import ROOT, mission

HEAVY = {"numpy", "cv2", "pydantic", "yaml", "rich", "structlog", "scipy", "numba", "mavsdk", "transitions", "jinja2"}


def imported_by(*arguments: str) -> set[str]:
    code = (
        "import json, sys\nfrom mission.cli.main import main\n"
        f"main({list(arguments)!r})\nprint('\\n' + json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return {name.partition(".")[0] for name in json.loads(done.stdout.splitlines()[-1])}


def test_help_imports_nothing_heavy() -> None:
    assert imported_by("--help") & HEAVY == set()


def test_the_help_of_the_longest_command_imports_nothing_heavy() -> None:
    """Pydantic is what typer reads typed parameters with."""
    assert imported_by("run", "--help") & HEAVY <= {"pydantic"}


def test_without_arguments_the_program_explains_itself(call: Call) -> None:
    said = call()
    assert said.code == 0
    assert "mission run missions/v80_blade.yaml" in said.out
    assert "Exit codes" in said.out


@pytest.mark.parametrize("name", sorted(commands()))
def test_every_command_explains_itself_with_an_example(call: Call, name: str) -> None:
    said = call(name, "--help")
    assert said.code == 0
    assert f"mission {name}" in said.out.partition("Usage:")[2].partition("\n")[2]
    assert commands()[name].endswith((".", "…"))


def test_every_command_has_its_place_in_the_help() -> None:
    assert set(commands()) <= {name for names in GROUPS.values() for name in names}


def test_a_new_module_is_a_new_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: Call) -> None:
    import mission.cli

    (tmp_path / "salute.py").write_text(
        '"""Greet."""\ndef salute(name: str) -> None:\n    """Greet."""\n    print(name)\n'
    )
    (tmp_path / "room.py").write_text('"""No command."""\ndef other() -> None: ...\n')
    monkeypatch.setattr(program, "_FOLDER", tmp_path)
    monkeypatch.setattr(mission.cli, "__path__", [*mission.cli.__path__, str(tmp_path)])
    assert commands() == {"salute": "Greet."}
    assert load("salute").name == "salute"
    assert call("salute", "you").out == "you\n"


def test_version(call: Call) -> None:
    from importlib.metadata import version

    assert call("--version").out == f"mission {version('blade-mission')}\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_offered_for_the_usual_shells(shell: str) -> None:
    said = mission("--show-completion", shell, env={"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"})
    assert said.code == 0
    assert "_MISSION_COMPLETE" in said.out


def test_completion_knows_the_commands_and_their_options() -> None:
    asked = {"_MISSION_COMPLETE": "complete_bash", "COMP_WORDS": "mission r", "COMP_CWORD": "1"}
    done = subprocess.run(
        [Path(sys.executable).parent / "mission"], cwd=ROOT, env=asked, capture_output=True, text=True, check=False
    )
    assert {"run", "report"} <= set(done.stdout.split())
    asked = {"_MISSION_COMPLETE": "complete_bash", "COMP_WORDS": "mission run --lock", "COMP_CWORD": "2"}
    done = subprocess.run(
        [Path(sys.executable).parent / "mission"], cwd=ROOT, env=asked, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["--lockstep"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["rnu"], "Did you mean 'run'"),
        (["--nonsense"], "--nonsense"),
        (["run", "--nonsense"], "--nonsense"),
        (["run", "a.yaml", "b.yaml"], "b.yaml"),
        (["run", "--speed", "fast"], "--speed"),
        (["run", "--speed", "0"], "--speed"),
        (["run", "--autonomy", "none"], "--autonomy"),
        (["report"], "run"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_exit_code_2(call: Call, arguments: list[str], words: str) -> None:
    said = call(*arguments)
    said.assert_one_line(2)
    assert words.lower() in said.err.lower()
    assert "--help`" in said.err


def test_an_error_nobody_expected_is_one_line_and_its_traceback_a_file(
    call: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    import tempfile

    def broken(name: str) -> None:
        raise ZeroDivisionError("of all things\n\x1b[31mred")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(program, "load", broken)
    said = call("doctor")
    assert said.code == 1
    assert said.err.count("\n") == 1
    assert said.err.strip().isprintable()
    (details,) = tmp_path.glob("mission-error-*.txt")
    assert str(details) in said.err
    assert "ZeroDivisionError" in details.read_text()
    assert "Traceback" in details.read_text()


@pytest.mark.parametrize(("raised", "code"), [(KeyboardInterrupt(), 130), (SystemExit(4), 4), (OSError(13, "No"), 2)])
def test_other_ends_have_their_codes(raised: BaseException, code: int) -> None:
    assert errors.explain(raised) == code


def test_a_missing_extra_names_the_command_that_installs_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert errors.explain(ModuleNotFoundError("No module named 'pymavlink'", name="pymavlink")) == 2
    assert "pip install 'blade-mission[sim]'" in capsys.readouterr().err


def test_a_reader_that_leaves_early_is_no_error() -> None:
    done = subprocess.run(
        f"{sys.executable} -m mission list codes | head -1", shell=True, cwd=ROOT, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.stderr == ""


def test_a_terminal_that_knows_only_ascii_gets_the_help_all_the_same() -> None:
    said = mission("--help", env={"PYTHONIOENCODING": "ascii"})
    assert said.code == 0
    assert "Exit codes" in said.out
