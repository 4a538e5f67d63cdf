"""Every monitor raises its event once its limit has been exceeded for long enough, and again after all was well."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flight.autopilot import Telemetry, VehiclePose
from mission.executive.commanded import MODE_OF, Commanded
from mission.executive.events import EVENTS
from mission.executive.monitors.monitor import Watch, look, monitors
from mission.executive.snapshot import Snapshot
from mission.language.limits import Limits


def telemetry(**changes: Any) -> Telemetry:
    pose = VehiclePose(0.0, np.array([10.0, 0.0, -30.0]), np.zeros(3), np.zeros(3), np.zeros(2))
    base = Telemetry(pose, True, 0.1, True, True, "OFFBOARD", True, 80.0, np.zeros(2), None, 0.0, None, 0.5)
    return replace(base, **changes)


def at(north: float) -> VehiclePose:
    return VehiclePose(0.0, np.array([north, 0.0, -30.0]), np.zeros(3), np.zeros(3), np.zeros(2))


def estimate(nearest: float = 3.0, sigma: float = 0.05, age: float = 0.1) -> Any:
    return SimpleNamespace(
        nearest_m=nearest, distance_m=nearest, distance_sigma_m=sigma, age_s=age, stamp_s=0.0, station_m=5.0
    )


def seen(nearest: float, stamp: float = 100.0, valid: bool = True) -> Any:
    return SimpleNamespace(valid=valid, nearest_m=nearest, stamp_s=stamp)


WELL = Snapshot(
    now=100.0,
    entered_s=50.0,
    telemetry=telemetry(),
    limits=Limits(),
    estimate=estimate(),
    vision_age_s=0.1,
    needs_vision=True,
    streaming=True,
    standoff_m=3.0,
    home=(0.0, 0.0, 0.0),
)

ILL: dict[str, dict[str, Any]] = {
    "too_close": {"observation": seen(1.9)},
    "standoff_lost": {"estimate": estimate(nearest=4.2)},
    "vision_lost": {"vision_age_s": 3.2},
    "battery_low": {"telemetry": telemetry(battery_percent=24.0)},
    "battery_critical": {"telemetry": telemetry(battery_percent=11.0)},
    "wind_high": {"telemetry": telemetry(wind=np.array([9.0, 12.0]))},
    "link_lost": {"telemetry": telemetry(link_age_s=1.2)},
    "geofence_breached": {"telemetry": telemetry(pose=at(150.0))},
    "gps_degraded": {"telemetry": telemetry(position_sigma_m=6.0)},
    "pilot_took_over": {"telemetry": telemetry(flight_mode="POSCTL")},
    "vehicle_failsafe": {"telemetry": telemetry(flight_mode="RTL")},
    "laser_fault": {"laser_fault": "interlock open"},
}


def raised(name: str, snapshot: Snapshot, seconds: float, watch: Watch | None = None) -> tuple[list[str], Watch]:
    """The events of one monitor while the world stays as it is."""
    watch = watch or Watch()
    found = []
    for tick in range(round(seconds * 10) + 1):
        now = snapshot.now + tick * 0.1
        instant = replace(snapshot, now=now)
        if instant.observation is not None and instant.observation.stamp_s >= snapshot.now:
            instant = replace(instant, observation=seen(instant.observation.nearest_m, now, instant.observation.valid))
        watch, name_raised = look(monitors()[name], watch, instant)
        if name_raised is not None:
            found.append(name_raised)
    return found, watch


def test_every_monitor_of_the_table_is_tried_here() -> None:
    assert set(ILL) == set(monitors())


@pytest.mark.parametrize("name", ILL)
def test_nothing_is_raised_while_all_is_well(name: str) -> None:
    assert raised(name, WELL, 10.0)[0] == []


@pytest.mark.parametrize("name", ILL)
def test_the_event_comes_once_after_its_persistence_and_again_after_recovery(name: str) -> None:
    monitor, ill = monitors()[name], replace(WELL, **ILL[name])
    if monitor.persist_s > 0.1:
        assert raised(name, ill, monitor.persist_s - 0.1)[0] == []
    events, watch = raised(name, ill, 8.0)
    assert events == [name]
    events, watch = raised(name, WELL, 1.0, watch)
    assert events == ([monitor.restored] if monitor.restored else [])
    assert raised(name, ill, 8.0, watch)[0] == [name]


@pytest.mark.parametrize("name", [name for name, monitor in monitors().items() if monitor.airborne])
def test_on_the_ground_it_is_silent(name: str) -> None:
    ill = replace(WELL, **ILL[name])
    assert raised(name, replace(ill, telemetry=replace(ill.telemetry, in_air=False)), 8.0)[0] == []


@pytest.mark.parametrize("name", [name for name, monitor in monitors().items() if monitor.limit])
def test_the_limit_it_names_exists_and_decides(name: str) -> None:
    limit = monitors()[name].limit
    assert limit is not None
    generous: dict[str, dict[str, float]] = {
        "battery_percent": {"battery_percent": 1.0, "battery_critical_percent": 0.0},
        "battery_critical_percent": {"battery_critical_percent": 0.0},
        "clearance_m": {"clearance_m": 0.5},
        "geofence_m": {"geofence_m": 1000.0},
        "standoff_error_m": {"standoff_error_m": 20.0},
        "wind_m_s": {"wind_m_s": 20.0},
    }
    limits = Limits(**generous.get(limit, {limit: 60.0}))
    assert raised(name, replace(WELL, **ILL[name], limits=limits), 8.0)[0] == []


def test_a_single_false_match_is_not_too_close() -> None:
    watch = Watch()
    ill = replace(WELL, observation=seen(1.0))
    for snapshot in (WELL, ill, replace(WELL, now=100.1), replace(ill, now=100.9)):
        watch, event = look(monitors()["too_close"], watch, snapshot)
        assert event is None


@pytest.mark.parametrize(
    "near",
    [
        {"observation": seen(1.5)},
        {"estimate": estimate(nearest=1.5)},
        {"telemetry": telemetry(range_m=1.5)},
    ],
)
def test_clearance_is_the_least_of_points_tracker_and_range_finder(near: dict[str, Any]) -> None:
    assert replace(WELL, **near).clearance_m == 1.5


@pytest.mark.parametrize(
    "old",
    [
        {"observation": seen(1.5, stamp=99.0)},
        {"observation": seen(1.5, valid=False)},
        {"estimate": estimate(nearest=1.5, age=5.0)},
        {"telemetry": telemetry(range_m=1.5, range_age_s=2.0)},
    ],
)
def test_what_is_old_or_refused_says_nothing_of_clearance(old: dict[str, Any]) -> None:
    assert replace(WELL, **old).clearance_m != 1.5


def test_vision_is_missed_only_where_it_is_needed() -> None:
    blind = replace(WELL, vision_age_s=30.0, estimate=None)
    assert raised("vision_lost", replace(blind, needs_vision=False), 10.0)[0] == []
    assert raised("vision_lost", replace(blind, vision_age_s=None), 10.0)[0] == []
    assert raised("vision_lost", blind, 1.0)[0] == ["vision_lost"]


def test_a_vague_estimate_counts_as_lost() -> None:
    assert raised("vision_lost", replace(WELL, estimate=estimate(sigma=0.7)), 1.0)[0] == ["vision_lost"]


def test_a_state_just_entered_gets_the_whole_bridge() -> None:
    assert raised("vision_lost", replace(WELL, vision_age_s=10.0, entered_s=99.5), 2.0)[0] == []


def test_a_blade_not_seen_yet_is_looked_for_longer() -> None:
    assert raised("vision_lost", replace(WELL, vision_age_s=10.0, seen=False), 5.0)[0] == []


def test_a_mode_chosen_before_take_off_is_no_pilot_taking_over() -> None:
    sticks = replace(WELL, telemetry=telemetry(flight_mode="POSCTL"))
    assert raised("pilot_took_over", replace(sticks, was_ours=False), 5.0)[0] == []


def commanded(*names: str, reported: bool = True) -> Commanded:
    made = Commanded()
    for name in names:
        made.asks(name)
        if reported:
            made.reported(MODE_OF[name])
    return made


@pytest.mark.parametrize(
    "names, streaming, ours, others",
    [
        (("take_off",), False, {"TAKEOFF", "HOLD"}, {"RTL", "LAND", "MISSION", "OFFBOARD"}),
        (("take_off", "start"), True, {"OFFBOARD"}, {"HOLD", "RTL", "LAND", "TAKEOFF"}),
        (("take_off", "start"), False, {"OFFBOARD", "HOLD", "LAND"}, {"RTL", "MISSION"}),
        (("start", "land"), False, {"LAND"}, {"HOLD", "RTL", "MISSION", "OFFBOARD"}),
        (("start", "hold"), False, {"HOLD"}, {"RTL", "LAND", "OFFBOARD"}),
    ],
)
def test_a_mode_that_nobody_here_commanded_is_somebody_elses(
    names: tuple[str, ...], streaming: bool, ours: set[str], others: set[str]
) -> None:
    modes = commanded(*names).modes(streaming=streaming)
    for mode in ours | others:
        snapshot = replace(WELL, telemetry=telemetry(flight_mode=mode), streaming=streaming, ours=modes)
        assert raised("vehicle_failsafe", snapshot, 5.0)[0] == ([] if mode in ours else ["vehicle_failsafe"]), mode


def test_a_command_that_was_not_obeyed_leaves_the_mode_before_it_ours() -> None:
    asked = commanded("start")
    asked.asks("land")
    assert asked.covers("OFFBOARD", streaming=True) and not asked.covers("RTL", streaming=True)
    asked.reported("LAND")
    assert not asked.covers("OFFBOARD", streaming=True)


def test_before_any_command_no_mode_of_the_autopilots_is_a_failsafe() -> None:
    ours = commanded().modes(streaming=False)
    flown = replace(WELL, telemetry=telemetry(flight_mode="MISSION"), streaming=False, ours=ours)
    assert raised("vehicle_failsafe", flown, 5.0)[0] == []


def test_a_handshake_over_a_socket_gets_its_wall_time_however_fast_the_mission_goes() -> None:
    slow = replace(WELL, telemetry=telemetry(flight_mode="HOLD"), speed=8.0)
    assert raised("vehicle_failsafe", slow, 11.0)[0] == []
    assert raised("vehicle_failsafe", slow, 13.0)[0] == ["vehicle_failsafe"]


def test_unknown_values_change_nothing() -> None:
    unknown = telemetry(battery_percent=float("nan"), wind=None, position_sigma_m=float("nan"), link_age_s=float("nan"))
    for name in monitors():
        assert raised(name, replace(WELL, telemetry=unknown), 10.0)[0] == []


def test_every_monitor_raises_an_event_that_says_so() -> None:
    for name, monitor in monitors().items():
        assert EVENTS[name].raised_by == "monitor"
        assert monitor.text
    told = {name for name, event in EVENTS.items() if event.raised_by == "monitor"}
    restored = {monitor.restored for monitor in monitors().values()}
    assert told <= set(monitors()) | restored
