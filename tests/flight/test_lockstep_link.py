"""The lockstep autopilot behaves as the Autopilot protocol says, on the simulated vehicle, and the same every time."""

import asyncio
import math

import numpy as np
import pytest

from devices.vehicle.settings import VehicleSettings
from devices.vehicle.truth_log import TruthLog
from devices.vehicle.vehicle import SimulatedVehicle
from flight.autopilot import AutopilotError, Setpoint
from flight.lockstep_link import LockstepAutopilot
from mission.executive.clock import LockstepLoop

THERE = Setpoint(np.array([6.0, 1.0, -9.0]), 0.8)


def in_lockstep(flight, folder=None, seed=3, **settings):
    """Run a coroutine function of a link on a fresh vehicle in lockstep time."""
    vehicle = SimulatedVehicle(VehicleSettings(**settings), seed)
    link = LockstepAutopilot(vehicle, TruthLog(folder, vehicle, wall=False) if folder else None)
    loop = LockstepLoop(link.advance)

    async def main():
        await link.connect(5)
        try:
            return await flight(link)
        finally:
            await link.close()

    try:
        return loop.run_until_complete(main())
    finally:
        loop.close()


async def until(condition):
    while not condition():  # noqa: ASYNC110
        await asyncio.sleep(0.1)


async def climb(link, height_m=9.0):
    await until(lambda: link.telemetry.armable)
    await link.arm()
    await link.take_off(height_m)
    await until(lambda: link.telemetry.flight_mode == "TAKEOFF")
    await until(lambda: link.telemetry.flight_mode == "HOLD")


async def stream(link, seconds):
    for _ in range(round(seconds * 20)):
        link.send(THERE)
        link.point_gimbal(0.5, 0.2)
        await asyncio.sleep(0.05)


def test_it_flies_to_setpoints_points_the_gimbal_and_lands():
    async def flight(link):
        await climb(link)
        await link.take_gimbal()
        await link.start_offboard(THERE)
        await stream(link, 10)
        there = link.telemetry
        await link.land()
        await until(lambda: not link.telemetry.armed)
        return there, link.telemetry

    there, landed = in_lockstep(flight)
    assert there.flight_mode == "OFFBOARD"
    assert there.in_air
    assert there.pose.position == pytest.approx(THERE.position, abs=0.3)
    assert there.pose.attitude[2] == pytest.approx(0.8, abs=0.05)
    assert there.pose.gimbal == pytest.approx([0.5, 0.2], abs=0.02)
    assert there.position_sigma_m > 0
    assert not landed.in_air


def test_two_runs_with_one_seed_leave_identical_records(tmp_path):
    async def flight(link):
        await climb(link)
        await link.start_offboard(THERE)
        await stream(link, 5)

    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        in_lockstep(flight, tmp_path / name, seed)
    for file in ("truth.csv", "vehicle_events.jsonl"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert (tmp_path / "a/truth.csv").read_bytes() != (tmp_path / "c/truth.csv").read_bytes()


def test_arming_too_early_is_an_error_with_the_reason():
    async def flight(link):
        with pytest.raises(AutopilotError, match=r"arm was refused: .*position"):
            await link.arm()

    in_lockstep(flight)


def test_when_send_stops_the_vehicle_holds_by_itself():
    async def flight(link):
        await climb(link)
        await link.start_offboard(THERE)
        await stream(link, 2)
        await asyncio.sleep(1.5)
        return link.telemetry.flight_mode

    assert in_lockstep(flight) == "HOLD"


def test_gimbal_angles_without_control_have_no_effect():
    async def flight(link):
        link.point_gimbal(0.0, 0.5)
        await asyncio.sleep(2)
        return link.telemetry.pose.gimbal[1]

    assert in_lockstep(flight) == pytest.approx(0, abs=0.01)


def test_a_cut_link_ages_and_commands_time_out():
    async def flight(link):
        await asyncio.sleep(1)
        link.up = False
        await asyncio.sleep(3)
        assert link.telemetry.link_age_s == pytest.approx(3, abs=0.1)
        assert not link.telemetry.connected
        with pytest.raises(AutopilotError, match="no answer"):
            await link.hold()
        link.up = True
        await asyncio.sleep(0.1)
        assert link.telemetry.connected

    in_lockstep(flight)


def test_poses_are_interpolated_between_the_samples_and_unknown_outside():
    async def flight(link):
        await climb(link)
        await link.start_offboard(THERE)
        await stream(link, 1.5)
        now = asyncio.get_running_loop().time()
        before, between, after = (link.pose_at(now - ago) for ago in (0.115, 0.105, 0.095))
        assert link.pose_at(now + 1) is None
        assert link.pose_at(now - 60) is None
        return before, between, after

    before, between, after = in_lockstep(flight, gps={"noise_m": 0.0})
    middle = (before.position + after.position) / 2
    assert np.linalg.norm(after.position - before.position) > 0.005
    assert between.position == pytest.approx(middle, abs=0.003)
    assert before.stamp_s < between.stamp_s < after.stamp_s


def test_parameters_that_do_not_exist_are_left_out():
    async def flight(link):
        return await link.parameters(["COM_OBL_RC_ACT", "NO_SUCH"])

    assert in_lockstep(flight) == {"COM_OBL_RC_ACT": 5.0}


def test_what_was_not_heard_is_not_a_number():
    link = LockstepAutopilot(SimulatedVehicle(VehicleSettings(), 1))
    telemetry = link.telemetry
    assert math.isnan(telemetry.pose.position[0])
    assert telemetry.global_position is None
    assert not telemetry.connected
