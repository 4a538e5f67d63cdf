"""Whatever stands in a file, reading it ends with findings or a mission: never with an exception."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mission.executive.events import EVENTS
from mission.language import semantics
from mission.language.document import load
from mission.language.exploration import Exploration
from mission.language.happening import safety_events
from mission.language.loading import examine
from mission.language.scenario_report import report, shown
from mission.language.semantics import Configuration
from tests.mission.language.missions import MISSIONS, written

V80 = (MISSIONS / "v80_blade.yaml").read_text()
SCENARIO = (MISSIONS / "scenarios" / "square.scenario.yaml").read_text().replace("../square.yaml", "square.yaml")
_JUNK = st.text(st.sampled_from(" \t\n:{}[],#&*!|>'\"%@`-?${}aon0\x00é\u202e"), max_size=4)
_CUTS = st.tuples(st.floats(0, 1), st.integers(0, 12), _JUNK)
_QUIET = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def cut(text: str, cuts: list[tuple[float, int, str]]) -> str:
    """The text with pieces taken out and junk put in."""
    for where, length, junk in cuts:
        at = int(where * len(text))
        text = text[:at] + junk + text[at + length :]
    return text


@_QUIET
@given(st.lists(_CUTS, min_size=1, max_size=3))
def test_damaged_missions_are_read_or_refused(tmp_path: Path, cuts: list[tuple[float, int, str]]) -> None:
    examination = examine(written(tmp_path, cut(V80, cuts).encode("utf-8", "replace").decode()))
    assert (examination.mission is None) == bool(examination.errors)
    assert all(str(finding).isprintable() and finding.location.file for finding in examination.diagnostics)


@_QUIET
@given(st.lists(_CUTS, min_size=1, max_size=3))
def test_damaged_scenarios_are_run_or_refused(tmp_path: Path, cuts: list[tuple[float, int, str]]) -> None:
    path = written(tmp_path, cut(SCENARIO, cuts), "damaged.scenario.yaml")
    for file in ("square.yaml", "parts/flight.yaml"):
        (path.parent / file).parent.mkdir(exist_ok=True)
        (path.parent / file).write_bytes((MISSIONS / file).read_bytes())
    assert shown(report(path))


@given(st.lists(st.text(max_size=30), max_size=3))
def test_overrides_of_any_text_are_applied_or_refused(overrides: list[str]) -> None:
    examination = examine(MISSIONS / "square.yaml", overrides)
    assert (examination.mission is None) == bool(examination.errors)


@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_safety_event_in_every_airborne_state_of_every_shipped_mission_is_answered(path: Path) -> None:
    mission = load(path)
    exploration = Exploration(mission)
    for leaf, situations in exploration.leaves.items():
        for name, event in EVENTS.items():
            answer = semantics.choose(mission, Configuration(leaf), name, {})
            final = mission.states[leaf].final is not None
            flying = any(exploration.flying(situation) for situation in situations)
            if final or not flying or event not in safety_events():
                continue
            if leaf in exploration.retreat and not event.lets_go and name not in ("failed", "behaviour_failed"):
                # On the way out only what ends the way out, or hands the vehicle over, is answered.
                assert answer is None or answer.target in exploration.retreat or mission.states[answer.target].final
            elif name != "failed" or mission.states[leaf].do is not None:
                assert answer is not None, (leaf, name)
                assert not answer.guarded
