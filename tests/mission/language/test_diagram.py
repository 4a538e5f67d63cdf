"""The diagram is a well-formed page with every state and event on it; a painted one shows where a run went."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from itertools import combinations
from pathlib import Path

import pytest

from mission.language import semantics
from mission.language.diagram.layout import layout
from mission.language.diagram.mermaid import mermaid
from mission.language.diagram.painting import painting
from mission.language.diagram.parts import kinds, label
from mission.language.diagram.svg import svg
from mission.language.document import load
from tests.mission.language.missions import MISSIONS, SMALL, written

SHIPPED = sorted(MISSIONS.glob("*.yaml"))


def texts(picture: str) -> list[str]:
    root = ElementTree.fromstring(picture)
    return [element.text or "" for element in root.iter("{http://www.w3.org/2000/svg}text")]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_every_state_and_event_is_on_the_page(path: Path) -> None:
    mission = load(path)
    written_out = texts(svg(mission))
    for state in mission.states.values():
        assert state.name in written_out
    for transition in mission.transitions():
        assert label(transition) in written_out


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_nothing_overlaps_and_everything_fits_on_the_page(path: Path) -> None:
    page = layout(load(path))
    assert page.height < 2.6 * page.width
    for box in page.boxes:
        assert box.x >= 0 and box.right <= page.width and box.y + box.height <= page.height
    leaves = [box for box in page.boxes if not box.composite]
    for one, other in combinations(leaves, 2):
        assert one.y + one.height <= other.y or other.y + other.height <= one.y
    for one, other in combinations(page.wires, 2):
        if one.lane_x == other.lane_x:
            low, high = _span(one), _span(other)
            assert low[1] < high[0] or high[1] < low[0]


def _span(wire: object) -> tuple[float, float]:
    heights = [port.y for port in wire.ports] + [wire.arrive[1]]  # type: ignore[attr-defined]
    return min(heights), max(heights)


def test_the_way_to_completion_and_safety_are_told_apart(tmp_path: Path) -> None:
    mission = load(written(tmp_path, SMALL))
    shown = {key: kind for key, kind in kinds(mission).items() if key.partition(":")[0] in ("launch", "work", "")}
    assert shown == {
        ":pilot_took_over#0": "safety",
        "launch:done#0": "way",
        "launch:failed#0": "safety",
        "launch:abort#0": "safety",
        "work:done#0": "way",
        "work:abort#0": "safety",
    }


def test_mermaid_text_has_every_state_once_and_every_way(tmp_path: Path) -> None:
    mission = load(MISSIONS / "v80_blade.yaml")
    text = mermaid(mission)
    arrows = [line for line in text.splitlines() if "==>|" in line or "-->|" in line or "-.->|" in line]
    assert len(arrows) == len(mission.transitions())
    assert text.count("subgraph ") == sum(1 for state in mission.states.values() if state.children)


def test_names_cannot_break_out_of_the_picture(tmp_path: Path) -> None:
    text = SMALL.replace("mission: small", "mission: small\ntext: '</svg><script>'")
    mission = load(written(tmp_path, text.replace("done: home", "done: {to: home, when: battery_percent < 50}")))
    picture = svg(mission)
    assert "[battery_percent < 50]" in " ".join(texts(picture)) and "<script" not in picture


def test_a_painted_diagram_shows_where_a_run_went_and_for_how_long(tmp_path: Path) -> None:
    mission = load(written(tmp_path, SMALL))
    configuration, seq = semantics.start(mission), 0
    lines = []
    for at, event in ((2.0, "passed"), (12.5, "done"), (20.0, "done")):
        transition = semantics.choose(mission, configuration, event, {})
        assert transition is not None
        step = semantics.take(mission, configuration, transition, event)
        entry = {"seq": seq, "t": at, "kind": "transition", "key": transition.key, "to": step.after.leaf}
        lines.append(json.dumps(entry))
        configuration, seq = step.after, seq + 1
    lines.append(json.dumps({"seq": seq, "t": 21.0, "kind": "end"}))
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "journal.jsonl").write_text("\n".join(lines) + "\n")
    painted = painting(mission, tmp_path / "run")
    assert painted.visits["launch"].seconds == 10.5 and painted.visits["work"].seconds == 7.5
    assert painted.visits["home"].seconds == 1.0 and "land" not in painted.visits
    assert painted.taken == {"preflight:passed#0": 1, "launch:done#0": 1, "work:done#0": 1}
    assert "10.5 s" in texts(svg(mission, painted))


def test_a_composite_counts_as_one_visit_for_as_long_as_it_is_not_left(tmp_path: Path) -> None:
    mission = load(MISSIONS / "square.yaml")
    ways = [(1.0, "square.north", "square.east"), (3.0, "square.east", "square.south"), (6.0, "square.south", "abort")]
    lines = [{"seq": 0, "t": 0.0, "kind": "transition", "key": "launch:done#0", "from": "launch", "to": "square.north"}]
    for seq, (at, source, target) in enumerate(ways, 1):
        to = mission.leaf(target)
        lines.append({"seq": seq, "t": at, "kind": "transition", "key": "x", "from": source, "to": to})
    (tmp_path / "journal.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    visits = painting(mission, tmp_path).visits
    assert (visits["square"].times, visits["square"].seconds) == (1, 6.0)
    assert (visits["square.east"].times, visits["square.east"].seconds) == (1, 2.0)
