"""The pre-flight check: which settings may fly beside a turbine, and what it says about those that may not."""

from __future__ import annotations

from dataclasses import replace
from math import nan

import numpy as np
import pytest

from flight.preflight import check
from tests.flight.fake_autopilot import HEALTHY, FakeAutopilot

SAFE = {"COM_OBL_RC_ACT": 5, "COM_OF_LOSS_T": 1.0, "COM_LOW_BAT_ACT": 2, "NAV_DLL_ACT": 0, "MNT_MODE_IN": 4}


async def levels(telemetry=HEALTHY, speed: float = 1.0, gimbal: bool = True, **parameters) -> dict[str, str]:
    values = {name: value for name, value in {**SAFE, **parameters}.items() if value is not None}
    findings = await check(FakeAutopilot(telemetry, values), battery_percent=40, speed=speed, gimbal=gimbal)
    assert len({finding.code for finding in findings}) == len(findings)
    for finding in findings:
        assert "\n" not in finding.text + finding.remedy
        assert (finding.level == "ok") == (finding.remedy == "")
    return {finding.code: finding.level for finding in findings}


async def test_a_fit_vehicle_has_nothing_to_say_against_it():
    assert set((await levels()).values()) == {"ok"}


@pytest.mark.parametrize("action", range(10))
async def test_only_landing_and_holding_are_fit_answers_to_a_lost_stream(action):
    level = (await levels(COM_OBL_RC_ACT=action))["offboard_loss_action"]
    assert level == ("ok" if action in (4, 5) else "refuse")


async def test_a_setting_that_lets_the_vehicle_fall_says_so_and_what_to_set():
    findings = await check(FakeAutopilot(HEALTHY, {**SAFE, "COM_OBL_RC_ACT": 7}), battery_percent=40)
    (finding,) = [f for f in findings if f.level == "refuse"]
    assert "falls" in finding.text
    assert "5" in finding.remedy


@pytest.mark.parametrize(
    ("seconds", "speed", "level"), [(1, 1, "ok"), (5, 1, "refuse"), (4, 4, "ok"), (20, 4, "refuse")]
)
async def test_the_offboard_time_out_is_judged_in_wall_time(seconds, speed, level):
    assert (await levels(speed=speed, COM_OF_LOSS_T=seconds))["offboard_loss_time"] == level


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"connected": False, "link_age_s": 3.0}, "link"),
        ({"armable": False}, "armable"),
        ({"armed": True}, "free"),
        ({"armed": True, "in_air": True}, "free"),
        ({"battery_percent": 30.0}, "battery"),
        ({"battery_percent": nan}, "battery"),
        ({"position_sigma_m": 9.0}, "position"),
        ({"pose": replace(HEALTHY.pose, position=np.full(3, nan))}, "position"),
    ],
)
async def test_an_unfit_vehicle_is_refused(change, code):
    found = await levels(replace(HEALTHY, **change))
    assert {name for name, level in found.items() if level == "refuse"} == {code}


async def test_what_the_autopilot_does_not_have_is_a_warning():
    found = await levels(
        COM_OBL_RC_ACT=None, COM_OF_LOSS_T=None, MNT_MODE_IN=None, COM_LOW_BAT_ACT=None, NAV_DLL_ACT=None
    )
    assert "refuse" not in found.values()
    assert list(found.values()).count("warn") == 5


async def test_a_gimbal_of_our_own_is_not_asked_of_the_autopilot():
    assert "gimbal" not in await levels(gimbal=False, MNT_MODE_IN=0)
    assert (await levels(MNT_MODE_IN=0))["gimbal"] == "warn"


async def test_a_straight_line_home_on_a_flat_battery_or_a_lost_station_is_warned_of():
    found = await levels(COM_LOW_BAT_ACT=3, NAV_DLL_ACT=2)
    assert (found["low_battery_action"], found["data_link_action"]) == ("warn", "warn")


async def test_a_link_that_breaks_during_the_check_is_refused_not_raised():
    autopilot = FakeAutopilot()
    autopilot.refuses = True
    findings = await check(autopilot, battery_percent=40)
    assert findings[-1].level == "refuse"
