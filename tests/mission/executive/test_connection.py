"""Which vehicles count as real, how fast their time is taken to run, and what they are given before they fly."""

from __future__ import annotations

from typing import Any

import pytest

from mission.executive.connection import (
    gimbal_for,
    is_simulated,
    must_confirm,
    parameters_at,
    speed_for,
    speed_mismatch,
)
from mission.language.rig_file import RigFile

CAMERA = {"width": 612, "height": 512, "focal_px": 616.0, "baseline_m": 0.2}
LISTENING = "udpin://0.0.0.0:14540"


def rig(kind: str, system: str = "embedded", **more: Any) -> RigFile:
    frames = {"frames": "frames"} if kind == "recorded" else {}
    return RigFile.model_validate({"kind": kind, "system": system, "camera": CAMERA, **frames, **more})


@pytest.mark.parametrize(
    ("kind", "in_file", "asked_for", "asks"),
    [
        ("simulated", "embedded", None, False),
        ("simulated", "embedded", "embedded", False),
        ("simulated", "embedded", LISTENING, False),
        ("simulated", "embedded", "tcpout://127.0.0.1:5760", False),
        ("simulated", "embedded", "udpout://localhost:14580", False),
        ("simulated", "embedded", "udpout://192.168.1.2:14580", True),
        ("simulated", "embedded", "tcpout://10.0.0.5:5760", True),
        ("simulated", "embedded", "serial:///dev/ttyACM0:921600", True),
        ("px4_sitl", LISTENING, None, False),
        ("px4_sitl", "serial:///dev/ttyACM0:57600", None, True),
        ("px4_sitl", LISTENING, "tcpout://10.0.0.5:5760", True),
        ("recorded", "embedded", None, False),
        ("recorded", "embedded", LISTENING, True),
        ("hardware", LISTENING, None, True),
        ("hardware", "serial:///dev/ttyACM0", None, True),
    ],
)
def test_a_person_is_asked_before_a_real_vehicle_is_armed(
    kind: str, in_file: str, asked_for: str | None, asks: bool
) -> None:
    assert must_confirm(rig(kind, in_file), asked_for) is asks
    assert is_simulated(rig(kind, in_file), asked_for) is not asks


@pytest.mark.parametrize("asks", [True, False])
@pytest.mark.parametrize("system", ["serial:///dev/ttyACM0", LISTENING])
def test_what_the_rig_says_about_arming_holds_for_every_vehicle(system: str, asks: bool) -> None:
    assert must_confirm(rig("hardware", system, confirm_arming=asks)) is asks
    assert must_confirm(rig("simulated", confirm_arming=asks), system) is asks
    assert not is_simulated(rig("hardware", system, confirm_arming=asks))


def test_the_embedded_simulator_s_speed_is_not_another_vehicle_s() -> None:
    fast = rig("simulated", speed=5)
    assert speed_for(fast, None, None) == 5
    assert speed_for(fast, LISTENING, None) == 1
    assert speed_for(fast, LISTENING, 4.0) == 4
    sitl = rig("px4_sitl", LISTENING, speed=2)
    assert speed_for(sitl, None, None) == 2
    assert speed_for(sitl, "serial:///dev/ttyACM0", None) == 1


def test_another_simulator_may_have_no_gimbal() -> None:
    assert gimbal_for(rig("simulated"), None) == "mavlink"
    assert gimbal_for(rig("simulated"), LISTENING) == "auto"
    assert gimbal_for(rig("px4_sitl", LISTENING, gimbal="in_process"), None) == "process"


def test_only_the_time_out_of_setpoints_goes_with_the_speed() -> None:
    given = parameters_at({"COM_OBL_RC_ACT": 5, "COM_OF_LOSS_T": 1.0}, 4.0)
    assert given == {"COM_OBL_RC_ACT": 5, "COM_OF_LOSS_T": 4.0}


def test_a_real_autopilot_s_parameters_are_not_a_rig_file_s() -> None:
    with pytest.raises(ValueError, match="parameters are for simulated autopilots"):
        rig("hardware", LISTENING, parameters={"COM_OBL_RC_ACT": 5})


class Link:
    def __init__(self, *measured: float | None) -> None:
        self.left = list(measured)

    async def measured_speed(self, wall_s: float = 1.0) -> float | None:
        return self.left.pop(0)


async def test_a_vehicle_whose_time_runs_otherwise_is_told_apart_in_one_line() -> None:
    complaint = await speed_mismatch(Link(0.99, 1.01, 1.0), 5.0, LISTENING)
    assert complaint is not None
    assert "1 times" in complaint and "5 times" in complaint and "--speed 1," in complaint
    assert "\n" not in complaint


@pytest.mark.parametrize("measured", [(4.2,), (2.0, 4.0), (1.0, 1.0, 3.5), (None,)])
async def test_a_vehicle_in_time_or_one_stutter_is_let_pass(measured: tuple[float | None, ...]) -> None:
    assert await speed_mismatch(Link(*measured), 4.0, LISTENING) is None
