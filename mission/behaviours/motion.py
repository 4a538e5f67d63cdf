"""Motions that behaviours share: fly to a place at a speed, stay. They steer by moving the stream's target."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from flight.autopilot import Setpoint
    from mission.executive.services import Services

    Array = NDArray[np.float64]

LEASH_S = 2.5  # the target runs at most this far ahead of the vehicle, in seconds of the wanted speed
YAW_RATE = math.radians(30.0)
FRESH_S = 1.0  # what was seen less long ago is there: two looks of an eye at 2 Hz


def wrap(angle: float) -> float:
    """The same angle in [-π, π)."""
    import numpy as np

    return (angle + np.pi) % (2 * np.pi) - np.pi


def target_or_here(services: Services) -> Setpoint:
    """The present target of the setpoint stream, or where the vehicle is."""
    from flight.autopilot import Setpoint

    if services.setpoints.target is not None:
        return services.setpoints.target
    pose = services.autopilot.telemetry.pose
    return Setpoint(pose.position.copy(), float(pose.attitude[2]))


def stay(services: Services) -> Setpoint:
    """Hold the present position and yaw from now on, or the last target where they are not known; returns the
    setpoint."""
    import numpy as np

    from flight.autopilot import Setpoint

    pose, last = services.autopilot.telemetry.pose, services.setpoints.target
    if last is not None and not (np.isfinite(pose.position).all() and np.isfinite(pose.attitude[2])):
        return last
    services.setpoints.target = Setpoint(pose.position.copy(), float(pose.attitude[2]))
    return services.setpoints.target


async def engage(services: Services) -> bool:
    """Make sure that the target is flown to: in the air and without a stream, begin one here.

    False where there is nothing to fly: the vehicle is on the ground. While somebody else flies, wait for the event
    that says so; nothing is commanded.

    Raises:
        AutopilotError: OFFBOARD was refused.
    """
    from flight.autopilot import Setpoint

    telemetry = services.autopilot.telemetry
    if services.streaming:
        return telemetry.in_air or telemetry.armed
    if not telemetry.in_air:
        return False
    while not (services.ours and services.commanded.took_over):
        services.progress.text = f"somebody else flies: {services.autopilot.telemetry.flight_mode}"
        await services.clock.sleep(0.2)
    pose = services.autopilot.telemetry.pose
    await services.setpoints.start(Setpoint(pose.position.copy(), float(pose.attitude[2])))
    return True


async def fly_to(
    services: Services,
    position: Array,
    yaw: float,
    *,
    speed_m_s: float,
    tolerance_m: float = 0.5,
    gimbal_pitch: float | None = 0.0,
) -> None:
    """Fly a straight line to a place (3,) m in local NED and turn to `yaw`; return when there and nearly at rest.

    The target slides along the line at `speed_m_s`, never more than a leash ahead of the vehicle. The keep-out volume
    still bounds every setpoint: a place inside it is never reached, and the state's deadline ends the attempt.
    """
    import numpy as np

    from flight.autopilot import Setpoint

    if not await engage(services):
        return
    last = services.clock.now()
    carrot, heading = target_or_here(services).position.copy(), target_or_here(services).yaw
    async for now in services.ticks():
        elapsed, last = now - last, now
        pose = services.autopilot.telemetry.pose
        leash = speed_m_s * LEASH_S + tolerance_m
        ahead = np.linalg.norm(carrot - pose.position)
        if ahead < leash:
            carrot = approach(carrot, position, speed_m_s * elapsed)
        turn = wrap(yaw - heading)
        heading = wrap(heading + float(np.clip(turn, -YAW_RATE * elapsed, YAW_RATE * elapsed)))
        services.setpoints.target = Setpoint(carrot.copy(), heading)
        if gimbal_pitch is not None:
            services.autopilot.point_gimbal(heading, gimbal_pitch)
        distance = np.linalg.norm(position - pose.position)
        at_rest = np.linalg.norm(pose.velocity) < max(0.4, 0.5 * tolerance_m)
        turned = abs(wrap(yaw - float(pose.attitude[2]))) < np.deg2rad(5)
        if distance < tolerance_m and at_rest and turned:
            services.setpoints.target = Setpoint(np.asarray(position, float).copy(), yaw)
            return


def approach(here: Array, there: Array, step_m: float) -> Array:
    """The point `step_m` from `here` on the way to `there`, or `there` when it is nearer."""
    import numpy as np

    way = there - here
    length = float(np.linalg.norm(way))
    result: Array = there.copy() if length <= step_m else here + way * (step_m / length)
    return result


def line_of_sight(services: Services) -> Array:
    """Unit vector (3,), horizontal, from the vehicle toward the turbine: the camera's when it looks that way, else the
    turbine's own axis. Needs no image."""
    import numpy as np

    yaw = float(services.autopilot.telemetry.pose.gimbal[0])
    sight = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    axis = np.array([np.cos(services.turbine.heading), np.sin(services.turbine.heading), 0.0])
    return sight if np.isfinite(yaw) and sight @ axis > 0.7 else axis
