"""From the ground into the air, and from the autopilot's modes into ours."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from flight.autopilot import AutopilotError, Setpoint
from mission.behaviours.behaviour import Parameters, behaviour

if TYPE_CHECKING:
    from mission.executive.services import Services


class TakeOff(Parameters):
    """Parameters of `take_off`."""

    height_m: float = Field(15.0, ge=2, le=120, description="height above the take-off point")


@behaviour(
    outcomes={"done": "hovering at the height, under our setpoints", "failed": "the autopilot refused"},
    parameters=TakeOff,
    airborne=None,
)
async def take_off(services: Services, parameters: TakeOff) -> str:
    """Arm, climb with the autopilot's own take-off, then take over with setpoints and take control of the gimbal."""
    autopilot = services.autopilot
    ground = autopilot.telemetry.pose.position.copy()
    services.memory.home = (float(ground[0]), float(ground[1]), float(ground[2]))
    try:
        if not autopilot.telemetry.armed:
            await autopilot.arm()
        await autopilot.take_off(parameters.height_m)
        while (climbed := float(ground[2] - autopilot.telemetry.pose.position[2])) < parameters.height_m - 0.7:
            services.progress.text = f"{climbed:.1f} of {parameters.height_m:.0f} m"
            await services.clock.sleep(0.2)
        pose = autopilot.telemetry.pose
        await services.setpoints.start(Setpoint(pose.position.copy(), float(pose.attitude[2])))
        await autopilot.take_gimbal()
    except AutopilotError as error:
        services.progress.text = str(error)
        services.log.warning("take_off", error=str(error))
        return "failed"
    return "done"
