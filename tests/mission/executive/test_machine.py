"""The compiled machine does exactly what the rules of the language say, whatever the mission and whatever happens."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from transitions.extensions.asyncio import HierarchicalAsyncMachine, NestedAsyncState

from mission.executive.machine import Machine, MachineError, entries
from mission.language import semantics
from mission.language.conditions import parse
from mission.language.document import Mission, State, Transition
from mission.language.limits import Limits

EVENTS = (
    "done",
    "found",
    "abort",
    "paused",
    "timed_out",
    "behaviour_failed",
    "failed",
    "battery_critical",
    "battery_low",
)
GUARDS = (None, "battery_percent < 50", "in_air", "not (battery_percent < 50 or in_air)")
QUANTITIES = ({}, {"battery_percent": 30.0}, {"battery_percent": 80.0, "in_air": True})


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    """Any mission of up to three levels."""
    parents: dict[str, str | None] = {}
    for top in range(draw(st.integers(2, 4))):
        parents[f"s{top}"] = None
        for middle in range(draw(st.integers(0, 3))):
            parents[f"s{top}.m{middle}"] = f"s{top}"
            for low in range(draw(st.integers(0, 2))):
                parents[f"s{top}.m{middle}.l{low}"] = f"s{top}.m{middle}"
    children = {path: tuple(child for child, parent in parents.items() if parent == path) for path in parents}
    paths = st.sampled_from(sorted(parents))

    def transition(source: str, index: int) -> Transition:
        guard = draw(st.sampled_from(GUARDS))
        return Transition(
            draw(st.sampled_from(EVENTS)),
            draw(paths),
            source,
            when=parse(guard) if guard else None,
            retries=draw(st.sampled_from((None, None, 1, 2))),
            history=draw(st.sampled_from((None, "shallow", "deep"))),
            index=index,
        )

    def entry(path: str) -> State:
        inner = children[path]
        return State(
            path,
            parents[path],
            on=tuple(transition(path, index) for index in range(draw(st.integers(0, 3)))),
            initial=draw(st.sampled_from(inner)) if inner else None,
            children=inner,
            entry=draw(st.booleans()),
        )

    nothing: Any = None
    states = {path: entry(path) for path in parents}
    on = tuple(transition("", index) for index in range(draw(st.integers(0, 2))))
    return Mission(
        "any", 1, states, draw(paths), nothing, nothing, nothing, None, Limits(), {}, "", nothing, on=on
    )  # fmt: skip


happenings = st.lists(
    st.tuples(st.sampled_from(EVENTS), st.sampled_from(QUANTITIES), st.integers(0, 3)), min_size=1, max_size=25
)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(missions(), happenings)
def test_library_and_rules_agree_on_any_sequence_of_events(mission: Mission, happening: list[Any]) -> None:
    async def walk() -> None:
        machine, configuration = Machine(mission), semantics.start(mission)
        for event, quantities, outward in happening:
            origin = (*configuration.active, *configuration.active[-1:] * 3)[outward] if outward else None
            chosen = semantics.choose(mission, configuration, event, quantities, origin)
            step = await machine.take(event, quantities, origin)
            if chosen is None:
                assert step is None
            else:
                assert step == semantics.take(mission, configuration, chosen, event)
                configuration = step.after
            assert machine.configuration == configuration
            assert machine.state == configuration.leaf

    asyncio.run(walk())


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(missions(), happenings)
def test_what_is_left_out_of_the_library_changes_nothing(mission: Mission, happening: list[Any]) -> None:
    class Dotted(NestedAsyncState):
        separator = "."

    class AsItComes(HierarchicalAsyncMachine):
        state_cls = Dotted

    async def walk() -> None:
        lean = Machine(mission)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("mission.executive.machine._Library", AsItComes)
            whole = Machine(mission)
        for event, quantities, _ in happening:
            assert await lean.take(event, quantities) == await whole.take(event, quantities)
            assert lean.state == whole.state

    asyncio.run(walk())


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(missions(), st.data())
def test_a_named_transition_is_taken_and_no_other(mission: Mission, data: st.DataObject) -> None:
    async def walk() -> None:
        machine = Machine(mission)
        able = [
            transition
            for owner in (*[mission.states[path].on for path in machine.configuration.active], mission.on)
            for transition in owner
            if semantics.guards_hold(transition, {})
        ]
        able.extend(entries(mission).values())
        if able:
            only = data.draw(st.sampled_from(able))
            step = await machine.take(only.event, {}, only=only)
            assert step is not None and step.transition.key == only.key

    asyncio.run(walk())


def test_a_machine_stands_where_it_is_put() -> None:
    states = {
        "a": State("a", None, initial="a.b", children=("a.b", "a.c")),
        "a.b": State("a.b", "a"),
        "a.c": State("a.c", "a"),
    }
    nothing: Any = None
    mission = Mission("t", 1, states, "a", nothing, nothing, nothing, None, Limits(), {}, "", nothing)
    assert Machine(mission).state == "a.b"
    assert Machine(mission, semantics.Configuration("a.c")).state == "a.c"


def test_a_disagreement_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    states = {"a": State("a", None, on=(Transition("done", "b", "a"),)), "b": State("b", None), "c": State("c", None)}
    nothing: Any = None
    mission = Mission("t", 1, states, "a", nothing, nothing, nothing, None, Limits(), {}, "", nothing)
    real = semantics.take

    def wrong(*about: Any) -> Any:
        step = real(*about)
        return replace(step, after=replace(step.after, leaf="c"))

    monkeypatch.setattr(semantics, "take", wrong)
    with pytest.raises(MachineError, match="went to b, the rules say c"):
        asyncio.run(Machine(mission).take("done", {}))
