"""What the documents promise is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from devices.world.settings import Faults
from mission.cli.main import commands
from tests.mission.cli.program import ROOT

NAMES = ("README.md", "ARCHITECTURE.md", "CHANGELOG.md", "docs/eye.md", "docs/faults.md", "docs/resume.md")
DOCUMENTS = [ROOT / name for name in NAMES]


def test_every_fault_is_documented_with_its_own_settings() -> None:
    text = (ROOT / "docs" / "faults.md").read_text()
    rows = dict(re.findall(r"^\| `(\w+)` \|.*\|(.*)\|$", text, re.MULTILINE))
    assert set(Faults.model_fields) <= set(rows)
    for name, field in Faults.model_fields.items():
        kind = next(option for option in field.annotation.__args__ if option is not type(None))
        own = set(kind.model_fields) - {"at_s", "state", "after_s", "for_s", "every_s"}
        assert own == set(re.findall(r"`(\w+)`", rows[name])), name


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_file_and_folder_that_a_document_names_is_there(document: Path) -> None:
    text = document.read_text()
    linked = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    named = re.findall(r"\b(?:missions|docs|devices|flight|mission|tests|vision)/[\w./]+", text)
    missing = [name for name in linked if not (document.parent / name).exists()]
    missing += [name for name in named if not (ROOT / name.rstrip("/.")).exists()]
    assert missing == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_every_command_that_a_document_uses_exists(document: Path) -> None:
    used = re.findall(r"(?:^|`)mission ([a-z]+)", document.read_text(), re.MULTILINE)
    assert set(used) <= set(commands())


def test_every_make_target_that_the_readme_names_exists() -> None:
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"(?:^|`)make ([a-z]+)", (ROOT / "README.md").read_text(), re.MULTILINE)) <= targets
