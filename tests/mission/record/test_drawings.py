"""The report's drawings put things where they are."""

from __future__ import annotations

import json
import math
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight.turbine import Turbine
from mission.record.folder import create
from mission.record.history import RunHistory
from mission.record.plots import Scale, Series, Span, blade_map, over_time, timeline
from mission.record.track import stand_of, views

FILES = {
    "mission": "v80_blade",
    "turbine": {"hub_height_m": 78.0, "blade_length_m": 39.0, "root_radius_m": 1.0, "overhang_m": 4.2},
    "site": {"turbine_north_m": 60.0, "turbine_east_m": 10.0, "ground_m": 2.0},
}


def history(tmp_path: Path, heading_deg: float = 8.0, azimuth_deg: float = 45.0) -> RunHistory:
    document = json.loads(json.dumps(FILES))
    document["turbine"]["azimuth_deg"] = azimuth_deg
    document["site"]["turbine_heading_deg"] = heading_deg
    return RunHistory(create(tmp_path, "a", json.dumps(document)))


@pytest.mark.parametrize("heading_deg", [0.0, 8.0, 140.0, 275.0])
@pytest.mark.parametrize("azimuth_deg", [0.0, 45.0, 90.0, 200.0])
def test_the_drawn_blade_is_where_flight_believes_it(tmp_path: Path, heading_deg: float, azimuth_deg: float) -> None:
    """Without tilt and cone, which the drawing leaves out, the tip of flight's turbine lies on the drawn one."""
    turbine = Turbine.surveyed(
        north_m=60.0, east_m=10.0, heading=math.radians(heading_deg), hub_height_m=78.0, overhang_m=4.2, ground_m=2.0,
        blade_length_m=39.0, root_radius_m=1.0, azimuth=math.radians(azimuth_deg), tilt=0.0, cone=0.0,
    )  # fmt: skip
    frame = turbine.blade_frame()
    north, east, down = frame.origin + 40.0 * frame.span
    stand = stand_of(history(tmp_path, heading_deg, azimuth_deg))
    assert stand is not None
    beyond, right = stand.seen_from(north, east)
    assert beyond == pytest.approx(0.0, abs=1e-6)
    assert (right, -down) == pytest.approx(stand.tips()[0], abs=1e-6)


def test_what_the_survey_found_is_drawn_rather_than_the_files(tmp_path: Path) -> None:
    run = history(tmp_path)
    memory = {"hub": [50.0, 5.0, -81.0], "heading": 0.5, "azimuth": 1.0}
    run.folder.journal.write_text(json.dumps({"seq": 0, "t": 0.0, "kind": "memory", **memory}) + "\n")
    stand = stand_of(run)
    assert stand is not None
    assert (stand.hub, stand.heading, stand.azimuth) == ((50.0, 5.0, 81.0), 0.5, 1.0)


def test_a_flight_is_drawn_from_the_front_and_from_above(tmp_path: Path) -> None:
    run = history(tmp_path)
    rows = [f"{t / 10},{t / 10},{t / 20},{-t / 10}" for t in range(400)]
    (run.folder.telemetry / "telemetry.csv").write_text("t,north,east,down\n" + "\n".join(rows) + "\n")
    front, plan = (ElementTree.fromstring(view) for view in views(run))
    for picture in (front, plan):
        points = picture.find("polyline")
        assert points is not None
        places = np.array([point.split(",") for point in points.attrib["points"].split()], float)
        assert places.min() >= 0
        assert np.all(places <= (470, 400))
    assert views(RunHistory(create(tmp_path, "empty", "mission: empty\n"))) == []


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e4))
def test_ticks_are_few_round_and_within(low: float, span: float) -> None:
    scale = Scale(low, low + span, 0.0, 100.0)
    ticks = scale.ticks()
    assert 2 <= len(ticks) <= 13
    assert all(low - 1e-6 * span <= tick <= low + span + 1e-6 * span for tick in ticks)
    step = ticks[1] - ticks[0]
    assert float(f"{step:.3g}") == pytest.approx(step, rel=1e-6, abs=1e-12)
    assert np.allclose(np.diff(ticks), step, rtol=1e-3)


@given(st.floats(-10, 10), st.floats(0.1, 10))
def test_a_scale_is_linear_between_its_ends(low: float, span: float) -> None:
    scale = Scale(low, low + span, 200.0, 20.0)
    assert scale(low) == pytest.approx(200.0)
    assert scale(low + span) == pytest.approx(20.0)
    assert scale(low + span / 2) == pytest.approx(110.0)


def test_a_state_s_bar_is_as_long_as_its_stay() -> None:
    picture = ElementTree.fromstring(
        timeline([Span("a", 0.0, 30.0), Span("abort.b", 30.0, 40.0), Span("a", 40.0, 60.0)])
    )
    bars = picture.findall("rect")
    widths = [float(bar.attrib["width"]) for bar in bars]
    assert widths[0] / widths[1] == pytest.approx(3.0, rel=0.01)
    assert widths[0] / widths[2] == pytest.approx(1.5, rel=0.01)
    assert [bar.attrib["class"] for bar in bars] == ["bar good", "bar bad", "bar good"]


def test_a_line_is_broken_where_a_value_is_missing() -> None:
    series = Series("distance", [(0.0, 1.0), (1.0, 2.0), (2.0, None), (3.0, 1.0), (4.0, 1.5)])
    picture = ElementTree.fromstring(over_time([series], unit=" m", rules=[1.2]))
    assert len(picture.findall("polyline")) == 2
    assert over_time([Series("x", [])], unit=" m") == ""


def test_the_covered_bar_is_as_long_as_the_stretch() -> None:
    picture = ElementTree.fromstring(blade_map([(1.0, 11.0, "covered"), (50.0, 60.0, "covered")], [], 1.0, 40.0))
    bars = {bar.attrib["class"]: float(bar.attrib["width"]) for bar in picture.findall("rect")}
    assert bars["covered"] / bars["uncovered"] == pytest.approx(10 / 39, rel=0.01)
    assert len(picture.findall("rect")) == 2
