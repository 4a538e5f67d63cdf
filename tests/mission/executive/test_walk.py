"""Every state of every shipped mission meets every event there is."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mission.behaviours import behaviour as registry
from mission.behaviours.behaviour import behaviours
from mission.executive import conductor as module
from mission.executive import executive as face
from mission.executive import resume
from mission.executive.events import EVENTS, Severity, fallbacks, outcomes
from mission.executive.machine import Machine
from mission.language import semantics
from mission.language.document import Mission, load
from mission.language.semantics import Configuration

SHIPPED = sorted(Path("missions").glob("*.yaml"))
URGENT = [name for name, entry in EVENTS.items() if entry.severity in (Severity.SAFETY, Severity.CRITICAL)]
ALWAYS = ("timed_out", "behaviour_failed", "failed", "pilot_took_over", "vehicle_failsafe")


@pytest.fixture(scope="module", params=SHIPPED, ids=lambda path: path.stem)
def mission(request: pytest.FixtureRequest) -> Mission:
    return load(request.param)


def at_work(mission: Mission) -> list[str]:
    """Leaves that are not final."""
    return [leaf for leaf in mission.leaves() if mission.states[leaf].final is None]


def aborting(mission: Mission) -> set[str]:
    """Leaves from which everything on leads home: where `abort` leads, and wherever one gets from there."""
    found: set[str] = set()
    fresh = {mission.leaf(entry.target) for entry in mission.transitions() if entry.event == "abort"}
    while fresh:
        leaf = fresh.pop()
        found.add(leaf)
        owners = [mission.states[path].on for path in mission.ancestors(leaf)]
        reached = {mission.leaf(entry.target) for owner in owners for entry in owner}
        fresh |= reached - found
    return found


def test_library_and_rules_agree_on_every_pair(mission: Mission) -> None:
    async def walk() -> int:
        pairs = 0
        for leaf in mission.leaves():
            machine = Machine(mission)
            for name in (*EVENTS, *outcomes()):
                machine.configuration = Configuration(leaf)
                machine._library.set_state(leaf)
                chosen = semantics.choose(mission, Configuration(leaf), name, {})
                step = await machine.take(name, {})
                expected = None if chosen is None else semantics.take(mission, Configuration(leaf), chosen, name)
                assert step == expected
                pairs += 1
        return pairs

    assert asyncio.run(walk()) == len(mission.leaves()) * (len(EVENTS) + len(outcomes()))


def test_every_safety_event_is_answered_unless_the_vehicle_is_already_on_its_way_home(mission: Mission) -> None:
    home = aborting(mission)
    for leaf in at_work(mission):
        for name in URGENT:
            chosen = semantics.choose(mission, Configuration(leaf), name, {})
            if chosen is None:
                assert leaf in home and name not in ALWAYS, f"{name} is not answered in {leaf}"


def test_a_final_state_is_never_left(mission: Mission) -> None:
    for leaf in set(mission.leaves()) - set(at_work(mission)):
        own = [entry for path in mission.ancestors(leaf) for entry in mission.states[path].on]
        assert own == []


@pytest.fixture
def idle(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every behaviour of the product, with its outcomes, but without its work."""

    async def wait(services: Any, parameters: Any) -> str:
        await asyncio.sleep(1e9)
        return ""

    known = {name: replace(entry, run=wait) for name, entry in behaviours().items()}
    for place in (registry, module, face, resume):
        monkeypatch.setattr(place, "behaviours", lambda: known)


def test_a_safety_event_wins_over_whatever_else_happens_in_the_same_instant(
    mission: Mission, fly: Any, idle: None
) -> None:
    """Flown by the executive itself: an outcome and an operator's event arrive first, the safety event last."""
    for leaf in at_work(mission):
        start = Configuration(leaf)
        behaviour = mission.states[leaf].do
        others = [*(behaviours()[behaviour].outcomes if behaviour else ()), "paused"]
        for name in URGENT:
            chosen = semantics.choose(mission, start, name, {})
            if chosen is None or semantics.delay_s(chosen, start):
                continue
            flight = fly({"any": {"final": "completed"}}, name=f"{leaf}-{name}.jsonl")
            flight.mission, flight.services.mission, flight.resume = mission, mission, start

            def happen(executive: Any, others: list[str] = others, name: str = name) -> None:
                for other in others:
                    if EVENTS.get(other, EVENTS["paused"]).severity.rank > EVENTS[name].severity.rank:
                        executive.raise_event(other)
                executive.raise_event(name)

            def stop(executive: Any) -> None:
                executive._ended = executive._ended or "walked"

            flight.at = [(0.05, happen), (0.3, stop)]
            flight.run()
            first = next(fields for kind, fields in flight.journal if kind == "transition")
            assert (first["event"], first["by"]) == (name, chosen.event)
            assert first["by"] in fallbacks(name)
            assert first["to"] == semantics.take(mission, start, chosen).after.leaf
