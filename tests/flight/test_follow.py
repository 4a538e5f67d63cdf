"""Following flown in closed loop on a blade whose truth is known: standoff, the edge in view, speed, at any blade
angle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from flight.guidance.follow import FollowSettings, FollowState, follow
from flight.turbine import Turbine
from tests.flight.synthetic_blade import MOUNT, VIEW, PointMass, SyntheticBlade, facing

HEADING = np.deg2rad(8)
TURBINE = Turbine.surveyed(
    north_m=60,
    east_m=10,
    heading=HEADING,
    hub_height_m=78,
    overhang_m=4.2,
    blade_length_m=39,
    root_radius_m=1,
    azimuth=0.0,
)


@dataclass
class Flight:
    standoff_error: np.ndarray
    in_view: np.ndarray
    speed: np.ndarray
    modes: set[str]
    stations: np.ndarray
    vehicle: PointMass


def settings_of(blade: SyntheticBlade, **changes) -> FollowSettings:
    return replace(FollowSettings(blade.frame, VIEW, MOUNT, HEADING), **changes)


def fly(
    blade: SyntheticBlade,
    settings: FollowSettings,
    start: float,
    end: float,
    gust: float = 0.0,
    lag: int = 0,
    dt: float = 0.1,
) -> Flight:
    vehicle, state, rng, wind = facing(blade, HEADING, start), FollowState(), np.random.default_rng(0), np.zeros(3)
    errors, views, speeds, modes, stations, past = [], [], [], set(), [], []
    while vehicle.stamp_s < 150:
        camera = vehicle.camera()
        past.append((blade.estimate(vehicle.stamp_s, camera), vehicle.pose()))
        command = follow(*past[max(0, len(past) - 1 - lag)], settings, state)
        state = command.state
        station = blade.frame.to_blade(camera.position)[0]
        if vehicle.stamp_s > 5:
            errors.append(blade.nearest(camera.position) - settings.standoff_m)
            views.append(blade.edge_in_view(camera, settings.side))
            speeds.append(command.speed_m_s)
            modes.add(command.mode)
            stations.append(station)
        wind += -wind * dt / 1.5 + rng.normal(size=3) * np.sqrt(dt) * gust
        for _ in range(5):
            vehicle.step(command.setpoint, (command.gimbal_yaw, command.gimbal_pitch), dt / 5, wind)
        if (station > end) == (settings.toward == "tip"):
            break
    return Flight(np.array(errors), np.array(views), np.array(speeds), modes, np.array(stations), vehicle)


def rmse(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("azimuth_deg", range(0, 360, 45))
@pytest.mark.parametrize(("side", "toward", "start", "end"), [("leading", "tip", 2, 16), ("trailing", "root", 20, 7)])
def test_every_blade_angle_is_followed_at_the_standoff_with_the_edge_in_view(azimuth_deg, side, toward, start, end):
    blade = SyntheticBlade(TURBINE.blade_frame(np.deg2rad(azimuth_deg)))
    flown = fly(blade, settings_of(blade, side=side, toward=toward), start, end)
    assert rmse(flown.standoff_error) <= 0.1
    assert flown.in_view.all()
    assert "wrong_side" not in flown.modes
    assert flown.speed[30:].mean() == pytest.approx(0.8, abs=0.05)


def test_a_whole_blade_out_and_back_in_gusts_and_with_late_estimates():
    blade = SyntheticBlade(TURBINE.blade_frame(np.deg2rad(135)))
    out = fly(blade, settings_of(blade), 2, 38.5, gust=0.4, lag=1)
    back = fly(blade, settings_of(blade, side="trailing", toward="root"), 38.5, 2, gust=0.4, lag=1)
    for flown in (out, back):
        assert rmse(flown.standoff_error) <= 0.15
        assert flown.in_view.all()
        assert {"both", "one"} <= flown.modes
        assert np.ptp(flown.stations) > 33


def test_a_vehicle_that_looks_past_the_edge_comes_back_over_the_blade():
    blade = SyntheticBlade(TURBINE.blade_frame(np.deg2rad(45)))
    settings = settings_of(blade, speed_m_s=0.0)
    vehicle = facing(blade, HEADING, 12.0)
    lead = blade.edges(12.0)[0]
    vehicle.position = vehicle.position + blade.frame.across * (lead + 0.3 - sum(blade.edges(12.0)) / 2)
    first = follow(blade.estimate(0.0, vehicle.camera()), vehicle.pose(), settings, FollowState())
    assert first.mode == "wrong_side"
    state = FollowState()
    for _ in range(120):
        command = follow(blade.estimate(vehicle.stamp_s, vehicle.camera()), vehicle.pose(), settings, state)
        state = command.state
        vehicle.step(command.setpoint, (command.gimbal_yaw, command.gimbal_pitch), 0.1)
    assert command.mode == "one"
    assert abs(command.cross_error_m) < 0.05
    assert blade.edge_in_view(vehicle.camera(), "leading")


def test_without_edges_the_vehicle_keeps_its_station_and_standoff():
    blade = SyntheticBlade(TURBINE.blade_frame(np.deg2rad(90)))
    vehicle, state = facing(blade, HEADING, 15.0), FollowState()
    start = blade.frame.to_blade(vehicle.position)
    for _ in range(100):
        estimate = replace(blade.estimate(vehicle.stamp_s, vehicle.camera()), leading=None, trailing=None)
        command = follow(estimate, vehicle.pose(), settings_of(blade), state)
        assert command.mode == "none"
        assert np.isnan(command.heading_image)
        state = command.state
        vehicle.step(command.setpoint, (command.gimbal_yaw, command.gimbal_pitch), 0.1)
    assert blade.frame.to_blade(vehicle.position)[:2] == pytest.approx(start[:2], abs=0.1)
    assert blade.nearest(vehicle.camera().position) == pytest.approx(3.0, abs=0.05)


@pytest.mark.parametrize("side", ["leading", "trailing"])
def test_an_edge_not_seen_for_long_is_looked_for_where_it_was(side):
    blade = SyntheticBlade(TURBINE.blade_frame(np.deg2rad(30)))
    vehicle = facing(blade, HEADING, 10.0)
    estimate = blade.estimate(0.0, vehicle.camera())
    lost = replace(getattr(estimate, side), age_s=9.0)
    command = follow(replace(estimate, **{side: lost}), vehicle.pose(), settings_of(blade, side=side), FollowState())
    toward = (command.setpoint.position - vehicle.position) @ blade.frame.across * (1 if side == "leading" else -1)
    assert command.mode == "none"
    assert 0 < toward < 0.6


def test_the_command_does_not_depend_on_which_way_north_is():
    def command(heading: float):
        turbine = TURBINE.refined(heading=HEADING + heading, hub=np.zeros(3), azimuth=0.7)
        blade = SyntheticBlade(turbine.blade_frame())
        vehicle = facing(blade, HEADING + heading, 12.0)
        settings = FollowSettings(blade.frame, VIEW, MOUNT, HEADING + heading)
        return follow(blade.estimate(0.0, vehicle.camera()), vehicle.pose(), settings, FollowState()), vehicle

    (a, va), (b, vb) = command(0.0), command(2.0)
    turned = np.array([[np.cos(2), -np.sin(2), 0], [np.sin(2), np.cos(2), 0], [0, 0, 1]])
    assert turned @ (a.setpoint.position - va.position) == pytest.approx(b.setpoint.position - vb.position, abs=1e-6)
    assert np.cos(b.setpoint.yaw - a.setpoint.yaw - 2.0) == pytest.approx(1)
    assert a.heading_image == pytest.approx(b.heading_image)


def test_the_thesis_heading_agrees_with_where_the_vehicle_is_sent():
    """With the edge at its least room both say: parallel to the edge."""
    blade = SyntheticBlade(TURBINE.blade_frame(np.deg2rad(60)))
    flown = fly(blade, settings_of(blade), 8, 14)
    camera = flown.vehicle.camera()
    estimate = blade.estimate(0.0, camera)
    command = follow(estimate, flown.vehicle.pose(), settings_of(blade), FollowState(speed_m_s=0.8))
    step = (command.setpoint.position - flown.vehicle.position) @ camera.rotation
    assert np.cos(command.heading_image - np.arctan2(step[2], step[1])) > np.cos(np.deg2rad(12))
