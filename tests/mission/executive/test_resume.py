"""A run that was cut off anywhere goes on: in its settled state, with what it knew, and no pass is flown twice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mission.executive.executive import Executive
from mission.executive.journal import JournalError, read_journal
from mission.executive.recollection import remembered
from mission.executive.replay import Played, replay
from mission.executive.resume import ResumeError, interrupted, last_of, where
from mission.executive.services import Memory, Stretch
from mission.language.semantics import Configuration


class Killed(KeyboardInterrupt):
    """Stands for SIGKILL: the event loop ends at once."""


def kill(executive: Executive) -> None:
    raise Killed


def a_pass(side: str) -> Any:
    async def fly_it(services: Any, parameters: Any) -> str:
        services.memory.values[side] = services.memory.values.get(side, 0.0) + 1.0
        for station in range(5):
            services.progress.station_m = float(station)
            await services.clock.sleep(1.0)
        services.memory.passes_done.append(side)
        return "done"

    return fly_it


PASSES = {"out": a_pass("leading"), "back": a_pass("trailing")}
INSPECTION = {
    "start": {"do": "finish", "on": {"done": "inspect", "abort": "aborted"}},
    "inspect": {
        "on": {"abort": "home", "paused": "holding"},
        "states": {
            "leading": {
                "do": "out",
                "on": {"done": "inspect.trailing", "failed": {"to": "inspect.leading", "retries": 2}},
            },
            "trailing": {"do": "back", "on": {"done": "completed"}},
        },
    },
    "holding": {"on": {"resumed": {"to": "inspect", "history": "deep"}, "abort": "home"}},
    "home": {"do": "finish", "on": {"done": "aborted"}},
    "completed": {"final": "completed"},
    "aborted": {"final": "aborted"},
}  # fmt: skip


def killed_at(fly: Any, seconds: float, name: str = "journal.jsonl", **about: Any) -> Any:
    flight = fly(INSPECTION, PASSES, name=name, at=[(seconds, kill)], **about)
    with pytest.raises(Killed):
        flight.run()
    return flight


def resumed(fly: Any, before: Any, path: Path, *, in_air: bool = True) -> Any:
    past = interrupted(path, before.mission)
    flight = fly(INSPECTION, PASSES, name=f"after-{path.name}", resume=where(before.mission, past, in_air=in_air))
    flight.services.memory = past.memory
    return flight


@pytest.mark.parametrize("seconds, begins", [(0.5, "start"), (3.2, "inspect.leading"), (7.0, "inspect.trailing")])
def test_a_killed_run_goes_on_in_its_settled_state(fly: Any, seconds: float, begins: str) -> None:
    before = killed_at(fly, seconds)
    after = resumed(fly, before, before.path)
    assert after.run().outcome == "completed"
    first = after.journal[0][1]
    assert first["resumed"] is True and first["state"] == begins


def test_a_pass_that_was_done_is_not_flown_again(fly: Any) -> None:
    before = killed_at(fly, 7.0)
    after = resumed(fly, before, before.path)
    after.run()
    assert after.walked == ["completed"]
    assert after.services.memory.values["leading"] == 1.0
    assert after.services.memory.passes_done == ["leading", "trailing"]


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seconds=st.floats(0.05, 10.9), cut=st.integers(0, 120))
def test_whenever_it_is_killed_and_wherever_the_last_line_is_torn_it_goes_on(
    fly: Any, tmp_path: Path, seconds: float, cut: int
) -> None:
    name = f"{seconds}-{cut}.jsonl"
    (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / f"after-{name}").unlink(missing_ok=True)
    before = killed_at(fly, seconds, name)
    lines = before.path.read_bytes().splitlines(keepends=True)
    before.path.write_bytes(b"".join(lines[:-1]) + lines[-1][:cut])
    after = resumed(fly, before, before.path)
    assert after.run().outcome == "completed"
    done = after.services.memory.passes_done
    assert sorted(set(done)) == ["leading", "trailing"] and len(done) == 2


def test_history_and_used_up_retries_come_back(fly: Any) -> None:
    before = fly(
        INSPECTION,
        PASSES,
        at=[
            (2.0, lambda executive: executive.raise_event("failed")),
            (3.0, lambda executive: executive.raise_event("paused")),
            (4.0, kill),
        ],
    )
    with pytest.raises(Killed):
        before.run()
    past = interrupted(before.path, before.mission)
    assert past.configuration == Configuration(
        "holding", {"inspect": "inspect.leading"}, {"inspect.leading:failed#0": 1}
    )
    after = resumed(fly, before, before.path)
    after.at = [(1.0, lambda executive: executive.raise_event("resumed"))]
    after.run()
    assert after.walked[0] == "inspect.leading"


def test_how_far_along_the_blade_it_was_comes_back(fly: Any) -> None:
    before = killed_at(fly, 5.4)
    station = interrupted(before.path, before.mission).station_m
    assert station is not None and 1.0 <= station <= 4.0


@pytest.mark.parametrize(
    "left_in, in_air, goes_on", [
        ("leading", True, "inspect.leading"),
        ("leading", False, "start"),
        ("home", True, "home"),
        ("home", False, "aborted"),
    ],
)  # fmt: skip
def test_on_the_ground_it_begins_anew_unless_it_was_on_its_way_home(
    fly: Any, monkeypatch: pytest.MonkeyPatch, left_in: str, in_air: bool, goes_on: str
) -> None:
    from dataclasses import replace

    from mission.executive import resume

    flight = fly(INSPECTION, PASSES)
    flying = {name: replace(entry, airborne=name != "wait") for name, entry in _known().items()}
    monkeypatch.setattr(resume, "behaviours", lambda: flying)
    past = interrupted_in(flight.mission, "inspect.leading" if left_in == "leading" else "home")
    assert where(flight.mission, past, in_air=in_air).leaf == goes_on


def test_a_landing_is_over_on_the_ground_and_only_flying_begins_anew(fly: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from dataclasses import replace

    from mission.executive import resume

    flight = fly(INSPECTION, PASSES)
    known = {
        name: replace(entry, airborne=None, outcomes={"landed": ""} if name == "finish" else {})
        for name, entry in _known().items()
    }
    monkeypatch.setattr(resume, "behaviours", lambda: known)
    assert where(flight.mission, interrupted_in(flight.mission, "home"), in_air=False).leaf == "home"
    assert where(flight.mission, interrupted_in(flight.mission, "holding"), in_air=False).leaf == "start"


def test_of_several_runs_the_newest_that_decided_anything_is_gone_on_with(fly: Any, tmp_path: Path) -> None:
    from mission.record.folder import RunFolder, log_line
    from mission.record.lineage import RunNote

    first = killed_at(fly, 7.0)
    folders = [RunFolder(tmp_path / name) for name in ("one", "two", "three")]
    for folder, before in zip(folders, (None, "one", "two"), strict=True):
        folder.frames.mkdir(parents=True)
        folder.mission.write_text("mission: test\n")
        log_line(folder, "run_created")
        RunNote(continues=before).write(folder)
    assert last_of(folders[2], first.mission).configuration.leaf == "start"
    folders[0].journal.write_bytes(first.path.read_bytes())
    folders[2].journal.write_bytes(b"")
    past = last_of(folders[2], first.mission)
    assert past.configuration.leaf == "inspect.trailing" and past.folder == folders[0].path
    assert past.memory.passes_done == ["leading"]


@pytest.mark.parametrize(
    "trace", ["knowledge.json", "summary.json", "telemetry/setpoints.csv", "frames/00001_left.jpg"]
)
@pytest.mark.parametrize("journal", [None, b"", b'{"seq": 0, "t": 0.0, "ki'])
def test_a_run_that_did_something_and_lost_its_journal_is_refused(
    fly: Any, tmp_path: Path, trace: str, journal: bytes | None
) -> None:
    from mission.record.folder import create

    folder = create(tmp_path / "logs", "test", "mission: test\n", 0)
    mission = fly(INSPECTION, PASSES).mission
    if journal is not None:
        folder.journal.write_bytes(journal)
    assert last_of(folder, mission).configuration.leaf == "start"
    (folder.path / trace).write_text("wall_s,t\n1.0,2.0\n")
    with pytest.raises(ResumeError, match=f"journal.jsonl: {'empty' if journal is not None else 'missing'}"):
        last_of(folder, mission)


def test_a_folder_that_this_program_never_began_is_refused(fly: Any, tmp_path: Path) -> None:
    from mission.record.folder import RunFolder

    (tmp_path / "made").mkdir()
    with pytest.raises(ResumeError, match=r"journal.jsonl: missing"):
        last_of(RunFolder(tmp_path / "made"), fly(INSPECTION, PASSES).mission)
    (tmp_path / "made" / "journal.jsonl").mkdir()
    with pytest.raises(JournalError, match="a plain file"):
        last_of(RunFolder(tmp_path / "made"), fly(INSPECTION, PASSES).mission)


@pytest.mark.parametrize(
    "line",
    [
        '"kind": "start", "format": 1',
        '"kind": "start", "format": 1, "state": ["start"]',
        '"kind": "start", "format": 1, "state": "start", "history": [1]',
        '"kind": "start", "format": 1, "state": "start", "taken": {"a": -1}',
        '"kind": "start", "format": 1, "state": "start", "memory": 7',
        '"kind": "start", "format": 1, "state": "start", "memory": {"home": [1]}',
        '"kind": "start", "format": 1, "state": "start", "memory": {"heading": Infinity}',
        '"kind": "start", "format": 1, "state": "start", "memory": {"inspected": {"leading": {"from": 1}}}',
        '"kind": "start", "format": 1, "state": "start"}\n{"seq": 1, "t": 1.0, "kind": "progress", "station_m": "x"',
    ],
)
def test_lines_that_somebody_damaged_are_named(fly: Any, tmp_path: Path, line: str) -> None:
    path = tmp_path / "damaged.jsonl"
    path.write_text(f'{{"seq": 0, "t": 0.0, {line}}}\n')
    with pytest.raises(ResumeError, match=r"damaged.jsonl:\d: this \w+ line was damaged or edited"):
        interrupted(path, fly(INSPECTION, PASSES).mission)


def test_history_of_a_state_that_the_mission_lacks_is_refused(fly: Any, tmp_path: Path) -> None:
    path = tmp_path / "other.jsonl"
    path.write_text(
        '{"seq":0,"t":0.0,"kind":"start","format":1,"state":"start","history":{"inspect":"inspect.gone"}}\n'
    )
    with pytest.raises(ResumeError, match=r"in inspect.gone, which \S+ does not have"):
        interrupted(path, fly(INSPECTION, PASSES).mission)


def interrupted_in(mission: Any, leaf: str) -> Any:
    from mission.executive.resume import Interrupted

    return Interrupted(Configuration(leaf), Memory(), 0.0)


def _known() -> Any:
    from mission.behaviours import behaviour

    return behaviour.behaviours()


def test_a_resumed_flight_first_holds_under_its_own_setpoints(fly: Any) -> None:
    before = killed_at(fly, 3.2)
    after = resumed(fly, before, before.path)
    after.services.setpoints.target = None
    seen: list[Any] = []
    after.at = [(0.1, lambda executive: seen.append(after.services.setpoints.target))]
    after.run()
    assert seen[0] is not None and seen[0].position.tolist() == [1.0, 2.0, -30.0]


def test_a_pilot_who_flies_meanwhile_keeps_the_vehicle(fly: Any) -> None:
    before = killed_at(fly, 3.2)
    after = resumed(fly, before, before.path)
    after.services.setpoints.target = None
    after.autopilot.says(flight_mode="POSCTL")
    assert after.run().outcome == "released"
    assert after.services.setpoints.target is None and after.autopilot.commands == []


def test_a_pilot_who_takes_over_while_it_is_taken_up_gets_it(fly: Any) -> None:
    before = killed_at(fly, 3.2)
    after = resumed(fly, before, before.path)

    async def start(first: Any) -> None:
        after.executive.raise_event("pilot_took_over")

    after.services.setpoints.start = start
    assert after.run().outcome == "released"
    assert after.autopilot.commands == []


def test_what_cannot_be_gone_on_with_is_refused_in_one_line(fly: Any, tmp_path: Path) -> None:
    ended = fly(INSPECTION, PASSES, name="ended.jsonl")
    ended.run()
    with pytest.raises(ResumeError, match="came to its end \\(completed\\)"):
        interrupted(ended.path, ended.mission)
    with pytest.raises(JournalError):
        interrupted(tmp_path / "none.jsonl", ended.mission)
    other = fly({"elsewhere": {"do": "finish", "on": {"done": "aborted"}}, "aborted": {"final": "aborted"}})
    killed = killed_at(fly, 3.0, "killed.jsonl")
    with pytest.raises(ResumeError, match="does not have"):
        interrupted(killed.path, other.mission)
    future = tmp_path / "future.jsonl"
    future.write_text('{"seq": 0, "t": 0.0, "kind": "start", "format": 99, "state": "start"}\n')
    with pytest.raises(ResumeError, match="format 99, this program reads format 1"):
        interrupted(future, ended.mission)


def test_memory_comes_back_as_it_was() -> None:
    from dataclasses import asdict

    memory = Memory(
        home=(1.0, 2.0, 3.0),
        heading=0.5,
        passes_done=["leading"],
        inspected={"leading": Stretch(4.0, 38.5, 0.3)},
        values={"hub_sigma_m": 0.2},
    )
    assert remembered({**asdict(memory), "of a later version": 1}) == memory


# Replay


async def played(path: Path, mission: Any) -> list[Played]:
    return [step async for step in replay(path, mission)]


async def test_a_replay_does_as_the_flight_did(fly: Any) -> None:
    import asyncio

    flight = fly(
        INSPECTION,
        PASSES,
        at=[
            (2.0, lambda executive: executive.raise_event("failed")),
            (3.0, lambda executive: executive.raise_event("paused")),
            (3.0, lambda executive: executive.raise_event("link_restored")),
            (5.0, lambda executive: executive.raise_event("resumed")),
            (5.5, lambda executive: executive.raise_event("wind_high")),
        ],
    )
    await asyncio.to_thread(flight.run)
    steps = await played(flight.path, flight.mission)
    assert all(step.difference is None for step in steps)
    assert [step.state for step in steps if step.step is not None] == flight.walked


async def test_a_replay_names_the_first_difference(fly: Any) -> None:
    import asyncio

    flight = fly(INSPECTION, PASSES)
    await asyncio.to_thread(flight.run)
    changed = fly(
        {**INSPECTION, "start": {"do": "finish", "on": {"done": "holding", "abort": "aborted"}}}, PASSES
    ).mission
    steps = await played(flight.path, changed)
    assert "start → inspect.leading" in str(steps[-1].difference) and "now start → holding" in str(steps[-1].difference)
    assert steps[-1].line == next(
        number for number, entry in enumerate(read_journal(flight.path), 1) if entry.kind == "transition"
    )


async def test_a_resumed_run_replays_too(fly: Any) -> None:
    import asyncio

    before = await asyncio.to_thread(killed_at, fly, 7.0)
    after = resumed(fly, before, before.path)
    await asyncio.to_thread(after.run)
    assert all(step.difference is None for step in await played(after.path, after.mission))
