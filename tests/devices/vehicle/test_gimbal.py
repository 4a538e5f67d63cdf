"""The gimbal follows with lag and rate limit, holds the horizon, and obeys only who is in control."""

import math

import pytest

from devices.vehicle.control import Target
from devices.vehicle.modes import Mode


def test_it_lags_and_turns_no_faster_than_its_rate(pilot):
    p = pilot(aircraft={"gimbal_lag_s": 0.12, "gimbal_rate_deg_s": 60})
    p.vehicle.gimbal.point(0.0, math.radians(90), yaw_lock=True)
    p.vehicle.step(1.0)
    assert math.degrees(p.vehicle.gimbal.yaw) == pytest.approx(60, abs=2)
    p.vehicle.step(3.0)
    bias = p.vehicle.estimate.yaw_bias
    assert p.vehicle.gimbal.yaw == pytest.approx(math.radians(90) - bias, abs=1e-3)
    p.vehicle.gimbal.point(math.radians(2), math.nan, yaw_lock=True)
    p.vehicle.step(0.12)
    assert math.degrees(p.vehicle.gimbal.pitch) == pytest.approx(2 * (1 - math.exp(-1)), abs=0.15)


def test_locked_yaw_stays_while_the_vehicle_turns_and_following_yaw_turns_with_it(pilot):
    p = pilot().airborne()
    p.vehicle.gimbal.point(0.2, 0.5, yaw_lock=True)
    p.stream(Target(0, 0, -10, yaw=1.0), 6)
    assert p.vehicle.gimbal.reading[0] == pytest.approx(0.5, abs=0.01)
    assert p.vehicle.gimbal.reading[1] == pytest.approx(0.2, abs=0.01)
    p.vehicle.gimbal.point(0.2, 0.5, yaw_lock=False)
    p.stream(Target(0, 0, -10, yaw=1.0), 4)
    assert p.vehicle.gimbal.reading[0] == pytest.approx(1.5, abs=0.03)


def test_a_stuck_gimbal_stays_where_it_is(pilot):
    p = pilot()
    p.vehicle.gimbal.stuck = True
    p.vehicle.gimbal.point(0.5, 0.5, yaw_lock=True)
    p.vehicle.step(2)
    assert (p.vehicle.gimbal.yaw, p.vehicle.gimbal.pitch) == (0.0, 0.0)


def test_control_is_lost_at_landing(pilot):
    p = pilot().airborne()
    p.vehicle.gimbal.take(1, 195)
    p.firmware.set_mode(Mode.LAND)
    p.until(lambda: not p.firmware.armed, 60)
    assert p.vehicle.gimbal.primary is None
