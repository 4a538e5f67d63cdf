"""The autopilot's judgement: what it refuses, and what it does when something is lost."""

import math

import pytest

from devices.vehicle.control import Target
from devices.vehicle.modes import Mode, Sticks
from devices.vehicle.results import Result

HERE = Target(0, 0, -10, yaw=0)


def test_arming_is_refused_until_there_is_a_position(pilot):
    p = pilot()
    p.vehicle.step(3.5)
    assert p.firmware.arm() is Result.TEMPORARILY_REJECTED
    p.vehicle.step(1.0)
    assert p.firmware.arm() is Result.ACCEPTED
    assert p.firmware.arm() is Result.ACCEPTED, "armed already"


def test_armed_without_taking_off_it_disarms_by_itself(pilot):
    p = pilot()
    p.vehicle.step(5)
    p.firmware.arm()
    assert p.until(lambda: not p.firmware.armed, 20) == pytest.approx(10, abs=0.1)


def test_disarming_in_the_air_is_refused(pilot):
    p = pilot().airborne()
    assert p.firmware.disarm() is Result.TEMPORARILY_REJECTED
    assert p.firmware.armed
    assert p.firmware.disarm(force=True) is Result.ACCEPTED
    p.vehicle.step(1)
    assert p.body.vd > 5, "it falls"


def test_offboard_without_a_stream_is_refused_in_the_air(pilot):
    p = pilot().airborne()
    assert p.firmware.set_mode(Mode.OFFBOARD) is Result.TEMPORARILY_REJECTED
    assert p.firmware.mode is Mode.HOLD


@pytest.mark.parametrize(
    ("action", "mode"), [(0, Mode.RTL), (1, Mode.RTL), (3, Mode.RTL), (4, Mode.LAND), (5, Mode.HOLD)]
)
def test_a_lost_stream_is_noticed_within_a_second_and_answered_as_configured(pilot, action, mode):
    p = pilot(parameters={"COM_OBL_RC_ACT": action}).airborne()
    p.stream(HERE, 3)
    last = p.firmware.setpoint_s
    p.until(lambda: p.firmware.mode is not Mode.OFFBOARD, 3)
    assert 1.0 <= p.vehicle.time_s - last <= 1.1
    assert p.firmware.mode is mode
    assert p.firmware.failsafe == "offboard_lost"
    assert p.noted("failsafe")[0].data["action"] == mode.name


def test_action_seven_disarms_in_the_air(pilot):
    p = pilot(parameters={"COM_OBL_RC_ACT": 7}).airborne()
    p.stream(HERE, 1)
    p.vehicle.step(2)
    assert not p.firmware.armed


def test_a_slow_stream_flaps_and_a_faster_one_holds_offboard(pilot):
    p = pilot().airborne()
    p.stream(HERE, 10, every_s=0.95)
    assert not p.noted("failsafe")
    p.stream(HERE, 10, every_s=1.2)
    assert len(p.noted("failsafe")) > 3


def test_when_the_stream_comes_back_so_does_offboard(pilot):
    p = pilot().airborne()
    p.stream(HERE, 1)
    p.vehicle.step(3)
    assert p.firmware.mode is Mode.HOLD
    p.firmware.offboard_setpoint(HERE)
    assert 0.02 <= p.until(lambda: p.firmware.mode is Mode.OFFBOARD, 1) <= 0.1


def test_a_mode_chosen_during_the_failsafe_ends_it(pilot):
    p = pilot().airborne()
    p.stream(HERE, 1)
    p.vehicle.step(2)
    assert p.firmware.set_mode(Mode.LAND) is Result.ACCEPTED
    p.firmware.offboard_setpoint(HERE)
    p.vehicle.step(0.5)
    assert p.firmware.mode is Mode.LAND


def test_hold_after_a_lost_stream_stops_within_a_metre(pilot):
    p = pilot().airborne()
    for i in range(100):
        p.stream(Target(0.04 * i, 0, -10, yaw=0), 0.05)
    at_loss = p.body.n
    p.vehicle.step(10)
    assert at_loss < p.body.n < at_loss + 1.2
    assert math.hypot(p.body.vn, p.body.ve) < 0.1


def test_the_time_factor_multiplies_the_time_outs(pilot):
    p = pilot(time_factor=4)
    assert p.firmware.parameters["COM_OF_LOSS_T"] == 4.0
    assert p.firmware.parameters["COM_DL_LOSS_T"] == 40
    assert p.firmware.parameters["COM_OBL_RC_ACT"] == 5


def test_after_landing_the_last_mode_is_back_and_offboard_cannot_be_armed(pilot):
    p = pilot().airborne()
    p.stream(HERE, 1)
    p.firmware.set_mode(Mode.LAND)
    p.until(lambda: not p.firmware.armed, 60)
    assert p.firmware.mode is Mode.OFFBOARD
    assert p.firmware.arm() is Result.TEMPORARILY_REJECTED
    p.firmware.set_mode(Mode.HOLD)
    assert p.firmware.arm() is Result.ACCEPTED


def test_return_climbs_flies_home_and_lands_there(pilot):
    p = pilot().airborne()
    p.stream(Target(40, 0, -10, yaw=0), 15)
    p.firmware.set_mode(Mode.RTL)
    top = [0.0]
    p.until(lambda: top.append(min(top[-1], p.body.d)) or not p.firmware.armed, 200)
    assert top[-1] < -30
    assert math.hypot(p.body.n, p.body.e) < 1.0


def test_the_battery_warns_then_holds_five_seconds_then_lands(pilot):
    p = pilot().airborne()
    p.vehicle.battery_drop(14)
    p.vehicle.step(1)
    assert p.noted("battery_low")
    assert p.firmware.mode is Mode.HOLD
    p.vehicle.battery_drop(6.5)
    p.until(lambda: p.firmware.failsafe == "battery_critical", 1)
    assert p.firmware.mode is Mode.HOLD
    assert p.until(lambda: p.firmware.mode is Mode.LAND, 10) == pytest.approx(5, abs=0.1)


def test_a_lost_ground_station_is_flagged_after_twelve_seconds(pilot):
    p = pilot().airborne()
    p.firmware.failsafes.gcs_heartbeat()
    assert p.until(lambda: bool(p.noted("datalink_lost")), 20) == pytest.approx(12, abs=0.1)
    assert p.firmware.mode is Mode.HOLD, "NAV_DLL_ACT is 0: nothing but the flag"


def test_the_pilots_switch_is_always_obeyed(pilot):
    p = pilot().airborne()
    p.stream(HERE, 1)
    p.vehicle.pilot_takes_over("POSCTL")
    p.firmware.offboard_setpoint(HERE)
    p.vehicle.step(1)
    assert p.firmware.mode is Mode.POSCTL
    p.firmware.pilot(Sticks(pitch=0.8))
    p.vehicle.step(3)
    assert p.body.vn > 3


def test_a_firm_stick_takes_over_from_an_automatic_mode(pilot):
    p = pilot().airborne()
    p.firmware.pilot(Sticks(roll=0.1))
    assert p.firmware.mode is Mode.HOLD
    p.firmware.pilot(Sticks(roll=0.9))
    assert p.firmware.mode is Mode.POSCTL


def test_a_manual_mode_needs_sticks(pilot):
    p = pilot().airborne()
    assert p.firmware.set_mode(Mode.POSCTL) is Result.TEMPORARILY_REJECTED


def test_an_unknown_parameter_in_the_settings_is_named(pilot):
    with pytest.raises(ValueError, match="COM_OF_LOS_T"):
        pilot(parameters={"COM_OF_LOS_T": 1})
