"""The flight link over a real socket, held against the simulated vehicle in its own process."""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the simulated vehicle speaks through pymavlink")

from devices.vehicle.settings import LinkSettings, ProcessSettings, VehicleSettings
from devices.vehicle.spawn import VehicleProcess, spawn
from devices.vehicle.truth_channel import TruthClient
from devices.world.settings import Gps, Wind
from flight.autopilot import AutopilotError, Setpoint
from flight.mavsdk_link import MavsdkAutopilot
from flight.preflight import check
from flight.setpoints import Sent, SetpointStream
from flight.udp_port import check_address
from mission.executive.clock import WallClock

SPEED = 8.0
CALM = VehicleSettings(wind=Wind(mean_m_s=0, gust_m_s=0), gps=Gps(drift_m_min=0, noise_m=0))


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


async def until(condition: Callable[[], bool], wall_s: float = 25.0) -> None:
    """Wait for something that will happen, for as long as a busy machine may need."""
    deadline = time.monotonic() + wall_s
    while not condition():
        assert time.monotonic() < deadline, "it did not happen"
        await asyncio.sleep(0.02)


@dataclass
class Rehearsal:
    vehicle: VehicleProcess
    truth: TruthClient
    autopilot: MavsdkAutopilot
    clock: WallClock
    sent: list[Sent] = field(default_factory=list)
    events: list[str] = field(default_factory=list)

    def stream(self) -> SetpointStream:
        return SetpointStream(self.autopilot, self.clock, on_sent=self.sent.append, on_event=self.events.append)

    async def up(self, height_m: float = 5.0) -> None:
        await until(lambda: self.autopilot.telemetry.armable)
        await self.autopilot.arm()
        await self.autopilot.take_off(height_m)
        await until(lambda: self.autopilot.telemetry.pose.position[2] < -0.9 * height_m)


@asynccontextmanager
async def rehearsal(settings: VehicleSettings = CALM, **options) -> AsyncIterator[Rehearsal]:
    vehicle = spawn(ProcessSettings(vehicle=settings, links=(LinkSettings(remote_port=free_port()),), speed=SPEED))
    clock, truth = WallClock(SPEED), TruthClient(vehicle.truth_port)
    autopilot = MavsdkAutopilot(vehicle.system_address, clock, simulated=True, **options)
    try:
        await autopilot.connect(15)
        yield Rehearsal(vehicle, truth, autopilot, clock)
    finally:
        await autopilot.close()
        truth.close()
        vehicle.stop()
        clock.close()


async def test_from_connection_to_landing_and_shutdown():
    texts: list[str] = []
    async with rehearsal(ground_station=True, on_status_text=lambda severity, text: texts.append(text)) as r:
        autopilot = r.autopilot
        await r.up()
        telemetry = autopilot.telemetry
        assert telemetry.armed and telemetry.in_air and telemetry.connected
        assert telemetry.battery_percent > 50
        await until(lambda: autopilot.telemetry.wind is not None)

        stream = r.stream()
        goal = np.array([4.0, -3.0, -7.0])
        await stream.start(Setpoint(goal, 0.8))
        assert autopilot.telemetry.flight_mode == "OFFBOARD"
        while np.linalg.norm(autopilot.telemetry.pose.position - goal) > 0.3:
            stream.stroke()
            await asyncio.sleep(0.05)
        assert np.linalg.norm(r.truth.pose().position - goal) < 0.6
        assert all(np.array_equal(sent.setpoint.position, goal) for sent in r.sent)
        assert np.all(np.diff([sent.wall_s for sent in r.sent]) > 0)

        await autopilot.hold()
        stream.stop()
        assert autopilot.telemetry.flight_mode == "HOLD"
        await autopilot.land()
        await until(lambda: not autopilot.telemetry.armed, 60)
        assert not autopilot.telemetry.in_air
        assert texts
        address = r.vehicle.system_address
        await autopilot.close()
        await autopilot.close()
        check_address(address)
        with pytest.raises(AutopilotError, match="closed"):
            autopilot.send(Setpoint(goal, 0.0))


async def test_when_the_stream_stops_the_vehicle_holds_and_when_it_returns_flies_on():
    async with rehearsal() as r:
        await r.up()
        stream = r.stream()
        await stream.start(Setpoint(np.array([0.0, 0.0, -5.0]), 0.0))
        await until(lambda: "setpoints_stalled" in r.events)
        count = len(r.sent)
        await until(lambda: r.autopilot.telemetry.flight_mode == "HOLD")
        assert len(r.sent) == count
        assert r.events.count("setpoints_stalled") == 1
        for _ in range(200):
            stream.stroke()
            await asyncio.sleep(0.02)
            if r.autopilot.telemetry.flight_mode == "OFFBOARD":
                break
        assert r.autopilot.telemetry.flight_mode == "OFFBOARD"
        stream.stop()


async def test_a_hung_program_does_not_keep_the_vehicle_in_offboard():
    async with rehearsal() as r:
        await r.up()
        stream = r.stream()
        await stream.start(Setpoint(np.array([0.0, 0.0, -5.0]), 0.0))
        stream.stroke()
        seen = len(r.sent)
        for _ in range(200):
            time.sleep(0.05)  # noqa: ASYNC251 - the loop itself hangs
            if r.autopilot.telemetry.flight_mode == "HOLD":
                break
        assert r.autopilot.telemetry.flight_mode == "HOLD"
        assert len(r.sent) == seen
        stream.stop()


async def test_pose_at_a_time_is_where_the_vehicle_truly_was():
    async with rehearsal() as r:
        await r.up()
        stream = r.stream()
        await stream.start(Setpoint(np.array([60.0, 20.0, -5.0]), 0.3))
        errors, speeds = [], []
        for _ in range(60):
            stream.stroke()
            before = r.clock.now()
            true = await asyncio.to_thread(r.truth.pose)
            after = r.clock.now()
            await asyncio.sleep(0.04)
            pose = r.autopilot.pose_at((before + after) / 2)
            if pose is not None and after - before < 0.1:
                errors.append(np.linalg.norm(pose.position - true.position))
                speeds.append(np.linalg.norm(true.velocity))
        stream.stop()
        assert max(speeds) > 3.0
        assert np.median(errors) < 0.25
        assert r.autopilot.pose_at(r.clock.now() - 100) is None
        assert r.autopilot.pose_at(r.clock.now() + 100) is None


async def test_the_gimbal_is_taken_pointed_and_reported_from_north_and_horizon():
    async with rehearsal() as r:
        autopilot = r.autopilot
        await autopilot.take_gimbal()

        def pointed() -> bool:
            autopilot.point_gimbal(0.6, -0.3)
            gimbal = autopilot.telemetry.pose.gimbal
            return bool(np.allclose(gimbal, [0.6, -0.3], atol=0.02))

        await until(pointed)
        assert r.truth.pose().gimbal == pytest.approx([0.6, -0.3], abs=0.06)


async def test_without_a_gimbal_protocol_one_in_process_takes_its_place():
    async with rehearsal(CALM.model_copy(update={"parameters": {"MNT_MODE_IN": 0}})) as r:
        await r.autopilot.take_gimbal()
        r.autopilot.point_gimbal(0.4, 0.2)
        await until(lambda: bool(np.allclose(r.autopilot.telemetry.pose.gimbal, [0.4, 0.2], atol=1e-6)))
        findings = await check(r.autopilot, battery_percent=20, speed=SPEED)
        assert {f.code: f.level for f in findings}["gimbal"] == "warn"


async def test_a_pilot_who_takes_over_is_seen():
    async with rehearsal() as r:
        await r.up()
        r.truth.command("pilot", mode="POSCTL")
        await until(lambda: r.autopilot.telemetry.flight_mode == "POSCTL")


async def test_a_link_that_is_cut_and_mended_is_seen_to_be():
    async with rehearsal() as r:
        assert r.autopilot.telemetry.connected
        r.truth.command("link", up=False)
        await until(lambda: not r.autopilot.telemetry.connected)
        assert r.autopilot.telemetry.link_age_s > 1
        r.truth.command("link", up=True)
        await until(lambda: r.autopilot.telemetry.connected)
        before = r.autopilot.telemetry.pose.stamp_s
        await until(lambda: r.autopilot.telemetry.pose.stamp_s > before)


async def test_a_vehicle_that_died_is_one_line_and_closing_is_still_clean():
    async with rehearsal() as r:
        r.vehicle.stop()
        with pytest.raises(AutopilotError) as refused:
            await r.autopilot.hold() if r.autopilot.telemetry.flight_mode != "HOLD" else await r.autopilot.land()
        assert "\n" not in str(refused.value)
        await r.autopilot.close()


async def test_arming_before_the_checks_pass_is_refused_in_words():
    async with rehearsal() as r:
        if not r.autopilot.telemetry.armable:
            with pytest.raises(AutopilotError, match="cannot be armed yet"):
                await r.autopilot.arm()


async def test_preflight_of_the_simulated_vehicle_passes_and_parameters_that_it_lacks_are_left_out():
    async with rehearsal() as r:
        await until(lambda: r.autopilot.telemetry.armable)
        findings = await check(r.autopilot, battery_percent=20, speed=SPEED)
        assert [f for f in findings if f.level == "refuse"] == []
        assert await r.autopilot.parameters(["COM_OBL_RC_ACT", "MPC_XY_VEL_MAX"]) == {
            "COM_OBL_RC_ACT": 5.0,
            "MPC_XY_VEL_MAX": 12.0,
        }


async def test_a_port_in_use_is_refused_before_anything_starts():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        with pytest.raises(AutopilotError, match=f"{port} is already in use"):
            await MavsdkAutopilot(f"udpin://127.0.0.1:{port}", WallClock()).connect(1)


async def test_a_connection_that_never_answers_ends_in_one_line():
    address = f"udpin://127.0.0.1:{free_port()}"
    with pytest.raises(AutopilotError, match="no autopilot on") as refused:
        await MavsdkAutopilot(address, WallClock()).connect(0.3)
    assert "\n" not in str(refused.value)
    check_address(address)


@pytest.mark.parametrize("address", ["14540", "udp:14540", "udpin://0.0.0.0", "udpin://0.0.0.0:99999", "udpin://:x"])
def test_a_malformed_address_is_told_apart_with_an_example(address):
    with pytest.raises(AutopilotError, match="write"):
        check_address(address)
