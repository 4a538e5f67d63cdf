"""Telemetry as messages build it: stamps on the executive's clock, poses between samples, and what each message
means."""

from __future__ import annotations

from math import isnan, nan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight.gimbal import ProcessGimbal, angles_from, attitude_message
from flight.pose_history import PoseHistory
from flight.px4_modes import name_of, numbers_of
from flight.stamps import StampMap
from flight.telemetry_intake import HANDLERS, TelemetryIntake
from vision.capture import rotation_of

SQRT_HALF = 0.5**0.5


class TestStamps:
    @given(st.floats(-100, 100), st.lists(st.floats(0, 0.05), min_size=20, max_size=60))
    def test_are_off_by_no_more_than_the_least_delay(self, offset, delays):
        stamps = StampMap(window_s=10)
        for n, delay in enumerate(delays):
            boot = 5 + 0.02 * n
            mapped, restarted = stamps.map(boot, boot + offset + delay, boot + delay)
            assert not restarted
        assert mapped - (boot + offset) == pytest.approx(min(delays), abs=1e-9)
        assert stamps.boot_of(mapped) == pytest.approx(boot)

    def test_follow_a_vehicle_whose_clock_has_lost_time(self):
        stamps = StampMap(window_s=0.5)
        for n in range(100):
            stamps.map(0.01 * n, 0.01 * n, 0.01 * n)
        for n in range(100, 200):
            mapped, _ = stamps.map(0.01 * n - 0.4, 0.01 * n, 0.01 * n)
        assert mapped == pytest.approx(1.99)

    def test_begin_anew_with_a_vehicle_that_restarted(self):
        stamps = StampMap()
        stamps.map(500.0, 10.0, 10.0)
        mapped, restarted = stamps.map(1.0, 12.0, 12.0)
        assert restarted
        assert mapped == 12.0

    def test_hold_when_time_runs_faster_than_wall(self):
        stamps = StampMap(window_s=0.5)
        for n in range(200):
            mapped, _ = stamps.map(0.04 * n, 0.04 * n + 7.0 + 0.02 * (n % 5), 0.01 * n)
        assert mapped == pytest.approx(0.04 * 199 + 7.0)


def history() -> PoseHistory:
    poses = PoseHistory()
    for n in range(11):
        t = 0.1 * n
        poses.position.add(t, (2 * t, -t, -10.0, 2.0, -1.0, 0.0))
        poses.attitude.add(t + 0.03, (0.0, 0.1, 3.0 + t))
        poses.gimbal.add(t + 0.01, (-3.0 - t, 0.2))
    return poses


class TestPoses:
    @given(st.floats(0.05, 1.3))
    def test_between_samples_and_just_beyond_them_are_where_a_straight_flight_is(self, t):
        pose = history().at(t)
        assert pose is not None
        assert pose.position == pytest.approx([2 * t, -t, -10.0], abs=1e-9)
        assert pose.stamp_s == t

    def test_angles_turn_the_short_way_across_pi(self):
        pose = history().at(0.58)
        yaw = 3.0 + 0.55
        assert np.cos(pose.attitude[2] - yaw) == pytest.approx(1)
        assert np.cos(pose.gimbal[0] - (-3.0 - 0.57)) == pytest.approx(1)

    @pytest.mark.parametrize("t", [-0.1, 0.02, 1.6, 99.0])
    def test_outside_the_record_there_is_none(self, t):
        assert history().at(t) is None

    def test_of_late_and_repeated_samples_the_first_order_is_kept(self):
        poses = history()
        poses.position.add(0.35, (99.0,) * 6)
        poses.position.add(1.0, (2.0, -1.0, -11.0, 2.0, -1.0, 0.0))
        assert poses.at(0.35).position[0] == pytest.approx(0.7)
        assert poses.at(1.0).position[2] == -11.0

    def test_without_a_gimbal_its_angles_are_not_a_number_and_all_else_is(self):
        poses = PoseHistory()
        poses.position.add(1.0, (1.0,) * 6)
        poses.attitude.add(1.0, (0.0, 0.0, 0.5))
        assert isnan(poses.latest().gimbal[0])
        assert poses.latest().position[0] == 1.0


def intake(now: float = 50.0) -> TelemetryIntake:
    made = TelemetryIntake(lambda: now)
    made.receive("HEARTBEAT", 1, {"base_mode": 0, "custom_mode": 4 << 16 | 3 << 24})
    made.receive("LOCAL_POSITION_NED", 1, {"time_boot_ms": 9000, "x": 1, "y": 2, "z": -3, "vx": 4, "vy": 5, "vz": 6})
    made.receive("ATTITUDE", 1, {"time_boot_ms": 9000, "roll": 0.1, "pitch": 0.2, "yaw": 0.3})
    return made


class TestMessages:
    def test_pose_and_time_are_on_the_executives_clock(self):
        pose = intake().telemetry().pose
        assert pose.stamp_s == pytest.approx(50.0)
        assert list(pose.position) == [1, 2, -3]
        assert list(pose.velocity) == [4, 5, 6]
        assert list(pose.attitude) == [0.1, 0.2, 0.3]

    def test_a_mode_is_known_as_soon_as_either_message_says_it(self):
        made = intake()
        assert made.telemetry().flight_mode == "HOLD"
        made.receive("CURRENT_MODE", 1, {"custom_mode": 6 << 16})
        assert made.telemetry().flight_mode == "OFFBOARD"

    def test_another_component_does_not_speak_for_the_autopilot(self):
        made = intake()
        made.receive("HEARTBEAT", 154, {"base_mode": 255, "custom_mode": 0})
        assert not made.telemetry().armed
        assert made.telemetry().flight_mode == "HOLD"

    @pytest.mark.parametrize(
        ("distance", "quality", "range_m"),
        [(350, 100, 3.5), (4001, 0, None), (10, 0, None), (350, 1, None), (350, 0, 3.5)],
    )
    def test_the_range_finder_is_believed_within_its_reach(self, distance, quality, range_m):
        made = intake()
        fields = {"min_distance": 20, "max_distance": 4000, "current_distance": distance, "signal_quality": quality}
        made.receive("DISTANCE_SENSOR", 1, {"orientation": 0, **fields})
        assert made.telemetry().range_m == range_m
        made.receive("DISTANCE_SENSOR", 1, {"orientation": 25, **fields, "current_distance": 99, "signal_quality": 0})
        assert made.telemetry().range_m == range_m

    def test_health_battery_wind_place_and_landed_state(self):
        made = intake()
        made.receive("SYS_STATUS", 1, {"onboard_control_sensors_health": 1 << 28, "battery_remaining": 61})
        made.receive("BATTERY_STATUS", 1, {"battery_remaining": -1})
        made.receive("WIND_COV", 1, {"wind_x": 3.0, "wind_y": -1.0})
        made.receive("GLOBAL_POSITION_INT", 1, {"lat": 473977419, "lon": 85455934, "alt": 488052})
        made.receive("EXTENDED_SYS_STATE", 1, {"landed_state": 2})
        made.receive("ESTIMATOR_STATUS", 1, {"pos_horiz_accuracy": 0.4})
        t = made.telemetry()
        assert (t.armable, t.battery_percent, t.in_air, t.position_sigma_m) == (True, 61.0, True, 0.4)
        assert list(t.wind) == [3.0, -1.0]
        assert t.global_position == pytest.approx([47.3977419, 8.5455934, 488.052])
        made.receive("WIND_COV", 1, {"wind_x": None, "wind_y": None})
        assert made.telemetry().wind is None

    def test_before_anything_is_heard_there_is_no_number(self):
        t = TelemetryIntake(lambda: 0.0).telemetry()
        assert not t.connected
        assert isnan(t.battery_percent) and isnan(t.pose.position[0])
        assert t.range_m is None

    def test_every_message_of_the_table_has_a_handler_that_names_it(self):
        assert {"HEARTBEAT", "LOCAL_POSITION_NED", "ATTITUDE", "DISTANCE_SENSOR", "COMMAND_ACK"} <= set(HANDLERS)


@pytest.mark.parametrize("mode", ["MANUAL", "POSCTL", "HOLD", "RTL", "LAND", "OFFBOARD", "TAKEOFF", "STABILIZED"])
def test_modes_round_trip_through_px4s_numbers(mode):
    main, sub = numbers_of(mode)
    assert name_of(main << 16 | sub << 24) == mode


def test_a_mode_that_is_not_known_is_still_told():
    assert name_of(4 << 16 | 77 << 24) == "MODE_4_77"


class TestGimbal:
    @given(st.floats(-pi, pi), st.floats(-1.4, 1.4))
    def test_angles_sent_are_angles_read(self, yaw, pitch):
        fields = attitude_message(yaw, pitch)
        back = angles_from(tuple(fields["q"]), 16, vehicle_yaw=1.0)
        assert np.cos(back[0] - yaw) == pytest.approx(1)
        assert back[1] == pytest.approx(pitch, abs=1e-6)

    @given(st.floats(-pi, pi), st.floats(-1.4, 1.4))
    def test_the_quaternion_is_the_camera_rotation(self, yaw, pitch):
        w, x, y, z = attitude_message(yaw, pitch)["q"]
        ahead = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
        assert ahead == pytest.approx(rotation_of(0, pitch, yaw)[:, 0], abs=1e-9)

    def test_a_yaw_that_follows_the_nose_is_turned_to_north(self):
        east_of_nose = (SQRT_HALF, 0.0, 0.0, SQRT_HALF)
        assert angles_from(east_of_nose, 32, vehicle_yaw=0.5)[0] == pytest.approx(pi / 2 + 0.5)
        assert angles_from(east_of_nose, 32 | 16, vehicle_yaw=0.5)[0] == pytest.approx(pi / 2 + 0.5)
        assert angles_from(east_of_nose, 64, vehicle_yaw=0.5)[0] == pytest.approx(pi / 2)
        assert angles_from(east_of_nose, 0, vehicle_yaw=0.5)[0] == pytest.approx(pi / 2 + 0.5)

    def test_one_in_process_turns_at_its_rate_the_short_way(self):
        gimbal = ProcessGimbal(rate=0.5)
        assert isnan(gimbal.at(0.0)[0])
        gimbal.point(0.0, 3.0, 0.0)
        gimbal.point(1.0, -3.0, 0.1)
        assert gimbal.at(0.5) == (3.0, 0.0)
        assert gimbal.at(1.1) == pytest.approx((3.05, 0.05))
        assert gimbal.at(9.0) == pytest.approx((-3.0, 0.1))
        assert not isnan(nan if gimbal.at(1.0)[0] is None else gimbal.at(1.0)[0])
