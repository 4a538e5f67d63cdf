"""The JSON Schema that editors use is up to date, accepts the shipped missions and finds their mistakes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from mission.language.document import load
from mission.language.schema import SHIPPED, schema, schema_text
from mission.language.tree import plain
from mission.language.yaml_text import parse
from tests.mission.language.missions import MISSIONS

REMEDY = "run: make schema"


@pytest.fixture(scope="module")
def validator() -> Any:
    loaded = schema()
    jsonschema.Draft202012Validator.check_schema(loaded)
    return jsonschema.Draft202012Validator(loaded)


def document(path: Path) -> Any:
    return plain(parse(path.read_text(), str(path), []))


def test_the_shipped_schema_is_the_generated_one() -> None:
    assert SHIPPED.read_text() == schema_text(), REMEDY


@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_missions_fit_the_schema_as_written_and_as_resolved(path: Path, validator: Any) -> None:
    assert [error.message for error in validator.iter_errors(document(path))] == []
    resolved = yaml.safe_load(load(path).resolved_yaml)
    resolved["on"] = resolved.pop(True, resolved.get("on", {}))
    assert [error.message for error in validator.iter_errors(json.loads(json.dumps(resolved)))] == []


LAID_OVER = """\
extends: v80_blade.yaml
mission: other
rig: {extends: rigs/simulated.yaml, speed: 3}
site: {extends: sites/coast.yaml, turbine_north_m: "${north_m}"}
parameters: {north_m: 70, wait_s: 3}
limits: {wind_m_s: "${wait_s}", clearance_m: ~}
states:
  launch: ~
  inspect: {include: parts/look.yaml, on: {paused: ~, vision_lost: {to: abort, after_s: "${wait_s}"}}}
"""


def test_what_is_laid_over_another_file_fits_the_schema(validator: Any) -> None:
    whole = plain(parse(LAID_OVER, "file", []))
    assert [error.message for error in validator.iter_errors(whole)] == []
    for before, after in (("speed: 3", "speeds: 3"), ("${wait_s}", "wait_s"), ("{include: parts", "{includes: parts")):
        assert before in LAID_OVER
        assert list(validator.iter_errors(plain(parse(LAID_OVER.replace(before, after), "file", [])))), after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("do: survey_turbine", "do: survey_turbin"),
        ("timeout_s: 240", "timeout: 240"),
        ("{height_m: 15}", "{heigth_m: 15}"),
        ("{height_m: 15}", "{height_m: high}"),
        ("tip_detected: confirm_tip", "tip_detect: confirm_tip"),
        ("history: deep", "history: deeep"),
        ("outcome: aborted", "outcome: abandoned"),
        ("clearance_m: 2.0", "clearance_m: -2.0"),
        ("mission: v80_blade", "mision: v80_blade"),
        ("side: leading, toward", "side: left, toward"),
    ],
)
def test_an_editor_finds_the_mistake(before: str, after: str, validator: Any) -> None:
    text = (MISSIONS / "v80_blade.yaml").read_text()
    assert before in text
    changed = plain(parse(text.replace(before, after, 1), "file", []))
    assert list(validator.iter_errors(changed)), after


@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_missions_tell_editors_where_the_schema_is(path: Path) -> None:
    first = path.read_text().splitlines()[0]
    marker, _, where = first.partition("$schema=")
    assert marker == "# yaml-language-server: " and (path.parent / where).resolve() == SHIPPED.resolve()
