"""The real mavsdk flies the simulated vehicle over UDP and sees what it would see of PX4."""

import asyncio
import json
import math

import numpy as np
import pytest
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.gimbal import ControlMode, GimbalAsync, GimbalError, GimbalMode, SendMode
from mavsdk.asyncio.plugins.mavlink_direct import MavlinkDirectAsync, MavlinkMessage
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import FlightMode, LandedState, TelemetryAsync

from devices.vehicle.settings import ProcessSettings
from devices.vehicle.spawn import spawn
from devices.vehicle.truth_channel import TruthClient

SPEED = 5.0
WAIT_S = 60.0


async def first(stream, condition):
    """The first value of a mavsdk subscription that satisfies the condition."""

    async def wait():
        async for value in stream:
            if condition(value):
                return value
        raise AssertionError("the stream ended")

    return await asyncio.wait_for(wait(), WAIT_S)


async def until(condition):
    async def wait():
        while not condition():  # noqa: ASYNC110
            await asyncio.sleep(0.05)

    await asyncio.wait_for(wait(), WAIT_S)


async def test_mavsdk_takes_off_flies_offboard_points_the_gimbal_loses_the_stream_and_lands():
    vehicle = await asyncio.to_thread(spawn, ProcessSettings(speed=SPEED))
    truth = TruthClient(vehicle.truth_port)
    try:
        configuration = Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER)
        async with Mavsdk(configuration) as mavsdk:
            await mavsdk.add_any_connection(vehicle.system_address)
            system = await mavsdk.first_autopilot(timeout_s=20)
            assert system is not None
            await fly(system, truth)
    finally:
        truth.close()
        vehicle.stop()


async def fly(system, truth):
    action, telemetry = ActionAsync(system), TelemetryAsync(system)
    parameters = ParamAsync(system)
    assert await parameters.get_param_float("COM_OF_LOSS_T") == pytest.approx(SPEED)
    assert await parameters.get_param_int("COM_OBL_RC_ACT") == 5

    health = await first(telemetry.subscribe_health(), lambda health: health.is_armable)
    assert health.is_global_position_ok
    assert health.is_home_position_ok

    await action.set_takeoff_altitude(8)
    await action.arm()
    await action.takeoff()
    await first(telemetry.subscribe_landed_state(), lambda state: state == LandedState.IN_AIR)
    await first(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD)
    assert truth.pose().position[2] == pytest.approx(-8, abs=0.4)
    with pytest.raises(Exception, match="DENIED"):
        await action.disarm()

    await point_gimbal(system, truth)

    stream = asyncio.create_task(stream_setpoints(system, 5.0, 2.0, -9.0))
    await asyncio.sleep(0.2)
    await MavlinkDirectAsync(system).send_message(message("COMMAND_LONG", OFFBOARD))
    await until(lambda: math.dist(truth.pose().position, (5, 2, -9)) < 0.5)
    await first(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.OFFBOARD)
    stream.cancel()
    await first(telemetry.subscribe_flight_mode(), lambda mode: mode == FlightMode.HOLD)

    await action.land()
    await first(telemetry.subscribe_armed(), lambda armed: not armed)
    assert truth.pose().position[2] == 0.0


OFFBOARD = {"command": 176, "confirmation": 0, "param1": 1, "param2": 6} | {f"param{i}": 0 for i in range(3, 8)}


def message(name, fields):
    target = {"target_system": 1, "target_component": 1}
    return MavlinkMessage(name, 0, 0, 1, 1, json.dumps(target | fields))


async def stream_setpoints(system, north, east, down):
    """One by one, so that they stop when this task does."""
    direct = MavlinkDirectAsync(system)
    zeros = dict.fromkeys(("time_boot_ms", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0)
    place = {"coordinate_frame": 1, "type_mask": 0b1001_1111_1000, "x": north, "y": east, "z": down}
    while True:
        await direct.send_message(message("SET_POSITION_TARGET_LOCAL_NED", zeros | place))
        await asyncio.sleep(0.05)


async def point_gimbal(system, truth):
    gimbal = GimbalAsync(system)
    found = await first(gimbal.subscribe_gimbal_list(), lambda found: bool(found.gimbals))
    number = found.gimbals[0].gimbal_id
    with pytest.raises(GimbalError):
        await gimbal.set_angles(number, 0, 15, 40, GimbalMode.YAW_LOCK, SendMode.ONCE)
    await gimbal.take_control(number, ControlMode.PRIMARY)
    await gimbal.set_angles(number, 0, 15, 40, GimbalMode.YAW_LOCK, SendMode.ONCE)
    await until(lambda: math.dist(np.degrees(truth.pose().gimbal), (40, 15)) < 2)
    attitude = await first(gimbal.subscribe_attitude(), lambda a: abs(a.euler_angle_north.pitch_deg - 15) < 1)
    assert attitude.euler_angle_north.yaw_deg == pytest.approx(40, abs=2)
