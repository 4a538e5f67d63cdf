"""The proof holds for sound missions, and finds in each unsound one the shortest way that shows why."""

from __future__ import annotations

from pathlib import Path

import pytest

from mission.language.document import Mission
from mission.language.exploration import Exploration
from mission.language.loading import examine
from mission.language.proof import EventProof, Proof, prove
from mission.language.proof_text import shown
from tests.mission.language.missions import MISSIONS, PREAMBLE, SMALL, STATES, written


def unchecked(path: Path) -> Mission:
    """A mission whose names are right, whatever else is wrong with it."""
    examination = examine(path, checked=False)
    assert examination.mission is not None, [str(finding) for finding in examination.diagnostics]
    return examination.mission


def proof_of(tmp_path: Path, text: str) -> Proof:
    return prove(unchecked(written(tmp_path, text)))


def about(proof: Proof, event: str) -> EventProof:
    return next(one for one in proof.events if one.event.name == event)


@pytest.mark.parametrize("path", sorted(MISSIONS.glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_missions_are_proven(path: Path) -> None:
    proof = prove(unchecked(path))
    assert proof.holds, [(one.event.name, one.failures) for one in proof.events if one.failures]


def test_the_longest_way_is_counted_with_its_deadlines(tmp_path: Path) -> None:
    # From work: abort leads to land, which ends after at most its 60 s; from home a failure leads there as well.
    way = about(proof_of(tmp_path, SMALL), "abort").longest
    assert way is not None and (way.steps, way.seconds) == (2, 60.0)
    assert [edge.target.leaf for edge in way.trace] == ["land", "aborted"]
    # A deadline in launch: launch → land → aborted. In finish the vehicle may have to be asked by `land` as well.
    assert about(proof_of(tmp_path, SMALL), "timed_out").longest.steps == 2


def test_a_missing_answer_is_shown_with_the_way_there(tmp_path: Path) -> None:
    proof = proof_of(tmp_path, SMALL.replace("on: {done: home, abort: land}", "on: {done: home, failed: land}"))
    failure = about(proof, "too_close").failures[0]
    assert failure.kind == "unanswered"
    assert [edge.target.leaf for edge in failure.trace] == ["launch", "work"]
    assert not about(proof, "behaviour_failed").failures and not proof.holds


def test_a_way_out_that_lasts_for_ever_is_a_deadlock(tmp_path: Path) -> None:
    text = SMALL.replace("on: {done: home, abort: land}", "on: {done: home, abort: wait}")
    text += "  wait: {do: hold, on: {done: land, abort: land}}\n"
    failure = about(proof_of(tmp_path, text), "abort").failures[0]
    assert failure.kind == "deadlock" and "'wait'" in failure.message
    assert [edge.target.leaf for edge in failure.trace] == ["launch", "work", "wait"]


def test_a_way_out_that_goes_round_is_a_livelock(tmp_path: Path) -> None:
    text = SMALL.replace("on: {done: home, abort: land}", "on: {done: home, abort: up}")
    text += "  up: {do: hold, timeout_s: 9, on: {done: down, failed: land}}\n"
    text += "  down: {do: hold, timeout_s: 9, on: {done: up, failed: land}}\n"
    failure = about(proof_of(tmp_path, text), "abort").failures[0]
    assert failure.kind == "livelock" and "up → down (done) → up (done)" in failure.message
    bounded = proof_of(tmp_path, text.replace("{done: up,", "{done: {to: up, retries: 4},"))
    assert not about(bounded, "abort").failures
    assert about(bounded, "abort").longest.steps >= 2 * 5


def test_work_that_goes_round_for_ever_is_a_livelock_though_every_abort_ends(tmp_path: Path) -> None:
    proof = proof_of(tmp_path, SMALL.replace("done: home", "done: work"))
    assert not proof.holds and not any(one.failures for one in proof.events)
    (failure,) = proof.failures
    assert failure.kind == "livelock" and "work → work" in failure.message
    assert [edge.target.leaf for edge in failure.trace][-1] == "work"


def test_a_way_out_that_needs_images_is_found(tmp_path: Path) -> None:
    text = SMALL.replace("on: {done: home, abort: land}", "on: {done: home, abort: look}")
    text += "  look: {do: align_gimbal, timeout_s: 9, on: {aligned: land, failed: land}}\n"
    failures = about(proof_of(tmp_path, text), "abort").failures
    assert [failure.kind for failure in failures] == ["vision"] and "'look'" in failures[0].message


def test_an_end_in_the_air_is_found(tmp_path: Path) -> None:
    text = SMALL.replace("on: {done: home, abort: land}", "on: {done: home, abort: aborted}")
    failure = about(proof_of(tmp_path, text), "abort").failures[0]
    assert failure.kind == "airborne" and failure.trace[-1].target.leaf == "aborted"


@pytest.mark.parametrize(
    ("statement", "holds"),
    [
        ("never: in(refused) and airborne", True),
        ("never: in(work) and not airborne", True),
        ("never: in(land) and airborne", False),
        ("never: [laser_on, recording]", True),
        ("always_eventually: ended", True),
        ("always_eventually: ended and not airborne or in(released)", True),
        ("always_eventually: in(completed)", False),
    ],
)
def test_invariants_that_a_mission_states_are_proven_or_refuted(tmp_path: Path, statement: str, holds: bool) -> None:
    proof = proof_of(tmp_path, PREAMBLE + statement + "\n" + STATES)
    assert proof.invariants and all((one.failure is None) == holds for one in proof.invariants)
    if not holds:
        assert proof.invariants[0].failure is not None and proof.invariants[0].failure.trace


def test_history_is_followed_wherever_it_may_lead(tmp_path: Path) -> None:
    text = SMALL.replace("on: {done: home, abort: land}", "on: {done: home, abort: land, paused: rest}")
    text += "  rest: {do: hold, timeout_s: 9, on: {resumed: work, done: work, abort: land}}\n"
    found = examine(written(tmp_path, text)).errors
    assert [finding.code for finding in found] == []  # resting again and again is the operator's will, not a cycle


PAUSED = """\
on: {pilot_took_over: released}
states:
  preflight: {do: check_vehicle, timeout_s: 60, on: {passed: launch, failed: refused, abort: refused}}
  launch: {do: take_off, timeout_s: 60, on: {done: work, failed: land, abort: land}}
  work:
    initial: near
    on: {abort: land, paused: rest}
    states:
      near: {do: hold, with: {for_s: 5}, timeout_s: 60, on: {done: far}}
      far: {do: hold, with: {for_s: 5}, timeout_s: 60, on: {done: home}}
  rest: {do: hold, timeout_s: 9, on: {resumed: {to: work, history: deep}, done: land, abort: land}}
"""
RESTING = SMALL.replace(SMALL[SMALL.index("on: {pilot") : SMALL.index("  home:")], PAUSED)


def test_history_leads_where_it_was_left_and_nowhere_else(tmp_path: Path) -> None:
    failure = (
        proof_of(tmp_path, RESTING.replace("initial: pre", "never: in(work.far)\ninitial: pre")).invariants[0].failure
    )
    assert failure is not None
    # Not over `rest`: whoever rests in `near` goes on in `near`.
    assert [edge.target.leaf for edge in failure.trace] == ["launch", "work.near", "work.far"]
    exploration = Exploration(unchecked(tmp_path / "missions" / "small.yaml"))
    resumed = {(edge.source.memory, edge.target.leaf) for edge in exploration.all_edges() if edge.event == "resumed"}
    assert resumed == {((("work", leaf),), leaf) for leaf in ("work.near", "work.far")}


def test_where_too_much_would_be_remembered_history_leads_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mission.language.exploration._MOST", 3)
    exploration = Exploration(unchecked(written(tmp_path, RESTING)))
    resumed = {edge.target.leaf for edge in exploration.all_edges() if edge.event == "resumed"}
    assert resumed == {"work.near", "work.far"} and not any(one.memory for one in exploration.situations)


def test_the_way_to_a_state_that_is_only_skipped_to_begins_at_the_beginning(tmp_path: Path) -> None:
    text = RESTING.replace(
        "  home:", "  aside: {do: hold, timeout_s: 9, entry: true, on: {done: land, abort: land}}\n  home:"
    )
    failure = proof_of(tmp_path, text.replace("initial: pre", "never: in(aside)\ninitial: pre")).invariants[0].failure
    assert failure is not None
    assert [(edge.source.leaf, edge.event) for edge in failure.trace] == [("preflight", "skip")]


def test_the_nearest_of_two_ways_to_go_on_for_ever_is_shown_with_its_events(tmp_path: Path) -> None:
    text = RESTING.replace("{done: far}", "{done: near}").replace("{done: home}", "{done: far}")
    text = text.replace("initial: pre", "always_eventually: ended\ninitial: pre")
    failure = proof_of(tmp_path, text).invariants[0].failure
    assert failure is not None and "work.near → work.near (done) can go on for ever" in failure.message
    assert [edge.target.leaf for edge in failure.trace] == ["launch", "work.near"]


def test_a_step_names_its_file_where_it_is_not_the_missions_own(tmp_path: Path) -> None:
    written(tmp_path, SMALL, "base.yaml")
    path = written(tmp_path, "extends: base.yaml\nmission: other\nnever: in(work)\n", "other.yaml")
    base = tmp_path / "missions" / "base.yaml"
    assert f"passed → launch   [{base}:9]" in shown(prove(unchecked(path)))
    assert "passed → launch   [line 10]" in shown(proof_of(tmp_path, PREAMBLE + "never: in(work)\n" + STATES))


def test_one_way_for_many_events_is_shown_once(tmp_path: Path) -> None:
    text = shown(proof_of(tmp_path, SMALL.replace("on: {done: home, abort: land}", "on: {done: home, failed: land}")))
    assert text.count("unanswered") > 5 and text.count("passed → launch") == 1
