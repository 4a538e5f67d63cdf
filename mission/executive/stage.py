"""Where a flight takes place: clock, autopilot, rig and, in simulation, the true world, set up and taken down again."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from mission.executive.belief import rig_geometry
from mission.executive.clock import LockstepClock, LockstepLoop, WallClock
from mission.executive.connection import (
    EMBEDDED,
    SIMULATED_KINDS,
    gimbal_for,
    is_simulated,
    parameters_at,
    speed_for,
    speed_mismatch,
    system_of,
)
from mission.executive.ready import takes_images
from mission.executive.simulation import Switch, build_world

if TYPE_CHECKING:
    from devices.rig import Rig
    from devices.vehicle.handover import RunningVehicle
    from devices.world.world import World
    from flight.autopilot import Autopilot
    from mission.executive.clock import Clock
    from mission.executive.options import FlightOptions
    from mission.executive.pace import Pace
    from vision.camera import RigGeometry


class FlightError(RuntimeError):
    """The flight could not begin; one line for a person."""


@dataclass
class Stage:
    """One flight's surroundings. world: None without a simulated one. switch: faults of the simulated vehicle.
    check: what is looked at once the vehicle is connected; raises FlightError. parameters: what the autopilot is given
    before it is armed. gone: whether the vehicle is known not to exist any more, as when its process has ended."""

    loop_factory: Callable[[], asyncio.AbstractEventLoop]
    clock: Clock
    autopilot: Autopilot
    rig: Rig
    world: World | None = None
    switch: Switch | None = None
    pace: Pace | None = None
    check: Callable[[], Awaitable[None]] | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    gone: Callable[[], bool] = lambda: False


@contextmanager
def lockstep_stage(options: FlightOptions, start_s: float = 0.0) -> Iterator[Stage]:
    """Everything in this process, and time that advances only as fast as it is computed."""
    from devices.simulated_rig import SimulatedRig
    from devices.vehicle.fault_switches import FaultSwitches
    from devices.vehicle.settings import VehicleSettings
    from devices.vehicle.truth_log import TruthLog
    from devices.vehicle.vehicle import SimulatedVehicle
    from devices.world.world import TruePose
    from flight.lockstep_link import LockstepAutopilot

    mission = options.mission
    world = build_world(mission)
    vehicle = SimulatedVehicle(VehicleSettings.of_world(world.settings), world.settings.seed, world.forward_range)
    autopilot = LockstepAutopilot(vehicle, TruthLog(options.folder.telemetry, vehicle, wall=False), start_s)
    clock = LockstepClock(start_s)

    def true_pose() -> TruePose:
        truth = vehicle.pose()
        return TruePose(truth.position, truth.attitude, truth.gimbal, truth.velocity)

    mount, looks = np.array(mission.rig.mount_m), takes_images(mission)
    rig = SimulatedRig(world, _geometry(options), mount, true_pose, clock.now, rehearse=looks)
    switches = FaultSwitches(vehicle, [autopilot])

    def switch(name: str, **arguments: object) -> None:
        switches.run(name, arguments)

    parameters = parameters_at(mission.rig.parameters, 1.0)
    yield Stage(lambda: LockstepLoop(autopilot.advance), clock, autopilot, rig, world, switch, parameters=parameters)


@contextmanager
def wall_stage(options: FlightOptions, start_s: float = 0.0) -> Iterator[Stage]:
    """A vehicle behind a socket, ours or another, and wall time, scaled where the vehicle's time is."""
    from devices.rig import CaptureError
    from flight.mavsdk_link import MavsdkAutopilot

    mission = options.mission
    rig_file = mission.rig
    system = system_of(rig_file, options.system)
    speed = speed_for(rig_file, options.system, options.speed)
    simulated = is_simulated(rig_file, options.system)
    with ExitStack() as stack:
        vehicle: RunningVehicle | None = None
        world = build_world(mission) if rig_file.kind in SIMULATED_KINDS else None
        if system == EMBEDDED:
            from mission.executive.embedded import embedded_vehicle

            vehicle = embedded_vehicle(options, speed)
            stack.callback(vehicle.stop)
            system = vehicle.system_address
        clock = WallClock(speed, start_s)
        stack.callback(clock.close)
        autopilot = MavsdkAutopilot(
            system,
            clock,
            simulated=simulated,
            gimbal=gimbal_for(rig_file, options.system),
        )
        try:
            rig, switch = _rig(options, stack, world, vehicle, clock, autopilot)
        except CaptureError as error:
            raise FlightError(str(error)) from error
        stack.callback(rig.close)
        pace = None
        if vehicle is not None:
            from devices.vehicle.truth_channel import TruthClient
            from mission.executive.pace import Pace

            hurry = TruthClient(vehicle.truth_port)  # of its own: vision waits for answers on the other
            stack.callback(hurry.close)
            pace = Pace(clock, speed, lambda faster: hurry.tell("speed", speed=faster))

        async def same_time() -> None:
            complaint = None if vehicle is not None else await speed_mismatch(autopilot, speed, system)
            if complaint is not None:
                raise FlightError(complaint)

        parameters = parameters_at(rig_file.parameters, speed) if simulated else {}  # a real one's are its owner's
        yield Stage(
            asyncio.new_event_loop,
            clock,
            autopilot,
            rig,
            world,
            switch,
            pace,
            check=same_time,
            parameters=parameters,
            gone=lambda: vehicle is not None and not vehicle.alive,
        )


def _geometry(options: FlightOptions) -> RigGeometry:
    try:
        return rig_geometry(options.mission.rig, options.mission.path.parent)
    except (OSError, ValueError) as error:
        raise FlightError(str(error)) from error


def _rig(
    options: FlightOptions,
    stack: ExitStack,
    world: World | None,
    vehicle: RunningVehicle | None,
    clock: WallClock,
    autopilot: Autopilot,
) -> tuple[Rig, Switch | None]:
    """The rig that the mission's rig file asks for, and the switches of the vehicle where it is ours."""
    from devices.simulated_rig import SimulatedRig
    from devices.world.world import TruePose

    mission = options.mission
    mount = np.array(mission.rig.mount_m)
    if vehicle is not None and world is not None:
        from devices.vehicle.truth_channel import TruthClient

        client = TruthClient(vehicle.truth_port)
        stack.callback(client.close)

        def true_pose() -> TruePose:
            truth = client.pose()
            return TruePose(truth.position, truth.attitude, truth.gimbal, truth.velocity)

        looks = takes_images(mission)
        return SimulatedRig(world, _geometry(options), mount, true_pose, clock.now, rehearse=looks), client.command
    if world is not None:

        def reported_pose() -> TruePose:
            pose = autopilot.telemetry.pose
            return TruePose(pose.position, pose.attitude, pose.gimbal, pose.velocity, pose.stamp_s)

        return SimulatedRig(world, _geometry(options), mount, reported_pose, clock.now), None
    if mission.rig.kind == "recorded":
        from devices.recorded_rig import RecordedRig

        folder = mission.path.parent / str(mission.rig.frames)
        return RecordedRig(folder, _geometry(options), clock.now), None
    from devices.camera_drivers import DRIVERS, open_rig

    if mission.rig.camera_driver is None:
        raise FlightError(f"the rig has no camera driver: give its rig file `camera_driver: {' | '.join(DRIVERS)}`")
    sources = [source if isinstance(source, int) else _source(options, source) for source in mission.rig.sources]
    return open_rig(mission.rig.camera_driver, _geometry(options), sources, clock.now), None


def _source(options: FlightOptions, source: str) -> str:
    """An address, or a file, looked for beside the mission."""
    return source if "://" in source else str(options.mission.path.parent / source)
