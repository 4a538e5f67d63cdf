"""The simulated vehicle moves like the PX4 SIH quadrotor that was measured, and the wind does not push it away."""

import math

import numpy as np
import pytest

from devices.vehicle.control import Target
from devices.vehicle.modes import Mode
from devices.world.settings import Gps, Wind


@pytest.mark.parametrize(("step_m", "top_m_s", "ninety_percent_s"), [(5.0, 2.8, 3.0), (30.0, 8.9, None)])
def test_position_step_is_answered_as_by_px4(pilot, step_m, top_m_s, ninety_percent_s):
    p = pilot().airborne()
    p.stream(Target(0, 0, -10, yaw=0), 3)
    track = []
    start = p.vehicle.time_s
    for _ in range(600):
        p.stream(Target(step_m, 0, -10, yaw=0), 0.02, every_s=0.02)
        track.append((p.vehicle.time_s - start, p.body.n, p.body.vn))
    t, n, vn = np.array(track).T
    assert vn.max() == pytest.approx(top_m_s, rel=0.05)
    assert n.max() < step_m * 1.01, "overshoot"
    assert n[-1] == pytest.approx(step_m, abs=0.05)
    if ninety_percent_s is not None:
        assert t[np.argmax(n > 0.9 * step_m)] == pytest.approx(ninety_percent_s, abs=0.3)


def test_take_off_to_ten_metres_takes_twelve_seconds(pilot):
    p = pilot()
    p.vehicle.step(5)
    p.firmware.arm()
    p.firmware.take_off(-10.0)
    took = p.until(lambda: p.firmware.mode is Mode.HOLD, 60)
    assert took == pytest.approx(12, abs=1.5)
    p.vehicle.step(5)
    assert p.body.d == pytest.approx(-10, abs=0.3)


def test_landing_from_ten_metres_takes_nineteen_seconds_and_ends_softly(pilot):
    p = pilot().airborne()
    p.firmware.set_mode(Mode.LAND)
    assert p.until(lambda: not p.firmware.armed, 60) == pytest.approx(19, abs=2)
    assert 0 < p.noted("landed")[0].data["impact_m_s"] < 0.8


def test_steady_wind_leaves_no_position_error(pilot):
    p = pilot(wind=Wind(mean_m_s=10, gust_m_s=10, from_deg=250)).airborne()
    p.stream(Target(0, 0, -10, yaw=0), 15)
    places = []
    for _ in range(100):
        p.stream(Target(0, 0, -10, yaw=0), 0.1)
        places.append((p.body.n, p.body.e, p.body.d + 10))
    assert np.abs(np.mean(places, axis=0)).max() < 0.05


def test_gusts_move_it_by_decimetres_at_most(pilot):
    p = pilot(wind=Wind(mean_m_s=8, gust_m_s=12)).airborne()
    p.stream(Target(0, 0, -10, yaw=0), 15)
    distances = []
    for _ in range(300):
        p.stream(Target(0, 0, -10, yaw=0), 0.1)
        distances.append(math.hypot(p.body.n, p.body.e))
    assert 0.005 < np.sqrt(np.mean(np.square(distances))) < 0.35


def test_wind_has_its_mean_and_never_exceeds_its_peak(pilot):
    wind = pilot(wind=Wind(mean_m_s=8, gust_m_s=12, from_deg=0)).vehicle.wind
    speeds = []
    for _ in range(50_000):
        wind.step(0.1)
        speeds.append(wind.velocity)
    north = np.array(speeds)[:, 0]
    assert -north.mean() == pytest.approx(8, abs=0.5), "from the north it blows southward"
    assert 11 < -north.min() <= 12.0 + 1e-9


def test_the_controller_flies_on_the_estimate_and_so_the_truth_is_off_by_its_error(pilot):
    p = pilot(gps=Gps(offset_north_m=1.5, offset_east_m=-0.5, drift_m_min=0)).airborne()
    p.stream(Target(3, 0, -10, yaw=0), 10)
    assert p.body.n == pytest.approx(1.5, abs=0.1)
    assert p.body.e == pytest.approx(0.5, abs=0.1)


def test_the_estimate_drifts_as_a_random_walk(pilot):
    ends = []
    for seed in range(60):
        p = pilot(gps=Gps(drift_m_min=0.3, noise_m=0))
        estimate = type(p.vehicle.estimate)(Gps(drift_m_min=0.3, noise_m=0), 0.0, np.random.default_rng(seed))
        for _ in range(600):
            estimate.update(p.body, 0.1)
        ends += estimate.error
    assert np.std(ends) == pytest.approx(0.3, rel=0.2)


def test_a_jump_of_the_estimate_moves_an_offboard_flight_but_not_a_hold(pilot):
    held = pilot().airborne()
    held.vehicle.gps_jump(3.0, 0.0)
    held.vehicle.step(8)
    assert abs(held.body.n) < 0.3
    steered = pilot().airborne()
    steered.stream(Target(0, 0, -10, yaw=0), 5)
    steered.vehicle.gps_jump(3.0, 0.0)
    steered.stream(Target(0, 0, -10, yaw=0), 8)
    assert steered.body.n == pytest.approx(-3.0, abs=0.3)


def test_one_seed_gives_one_flight(pilot):
    def end(seed_wind: float) -> tuple[float, ...]:
        p = pilot(wind=Wind(mean_m_s=seed_wind, gust_m_s=9)).airborne()
        return p.body.n, p.body.e, p.body.d, p.vehicle.estimate.n, p.vehicle.gimbal.reading[0]

    assert end(6) == end(6)
    assert end(6) != end(7)


def test_the_battery_empties_in_its_minutes_of_hover(pilot):
    p = pilot(aircraft={"battery_percent": 90, "battery_minutes": 10}).airborne()
    before = p.vehicle.battery.percent
    p.vehicle.step(60)
    assert before - p.vehicle.battery.percent == pytest.approx(10, rel=0.1)
    assert 12 < p.vehicle.battery.voltage_v < 17


def test_the_range_finder_asks_the_world_with_the_true_pose(pilot):
    asked = []

    def wall(position, attitude):
        asked.append((position, attitude))
        return 12.0 - position[0]

    p = pilot(gps=Gps(offset_north_m=2, drift_m_min=0))
    p.vehicle.forward_range = wall
    p.airborne()
    p.stream(Target(4, 0, -10, yaw=0), 10)
    assert p.vehicle.range_m == pytest.approx(12.0 - p.body.n, abs=0.2)
    assert asked[-1][0][0] == pytest.approx(2, abs=0.2), "true, not estimated"
    p.vehicle.range_working = False
    p.vehicle.step(0.2)
    assert p.vehicle.range_m is None
