"""From the ground into the air, and from the autopilot's modes into ours."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import fly_to

if TYPE_CHECKING:
    from flight.autopilot import Setpoint
    from mission.executive.services import Services


CLIMB_M_S = 1.5
HOLDS_BELOW_M = 2.0  # the autopilot's take-off is over, and it holds, within its own tolerance below the height
REPORT_S = 1.0  # wall; a mode may be reported that late


class TakeOff(Parameters):
    """Parameters of `take_off`."""

    height_m: float = Field(15.0, ge=2, le=120, description="height above the take-off point")


@behaviour(
    outcomes={"done": "hovering at the height, under our setpoints", "failed": "the autopilot refused"},
    parameters=TakeOff,
    airborne=None,
)
async def take_off(services: Services, parameters: TakeOff) -> str:
    """Arm, climb with the autopilot's own take-off, then take over with setpoints and take control of the gimbal.

    A vehicle that is in the air already, as after an interruption, climbs the rest under setpoints; home stays where it
    took off.
    """
    from flight.autopilot import AutopilotError, Setpoint

    autopilot = services.autopilot
    ground = autopilot.telemetry.pose.position.copy()
    home = services.memory.home
    if autopilot.telemetry.in_air:
        if home is None:
            services.progress.text = "in the air, and nobody knows where from"
            return "failed"
        here = Setpoint(ground.copy(), float(autopilot.telemetry.pose.attitude[2]))
        return await _climb_on(services, here, home[2] - parameters.height_m)
    if autopilot.telemetry.armed and not services.commanded.took_over:
        services.progress.text = "armed by somebody else"
        return "failed"
    services.memory.home = (float(ground[0]), float(ground[1]), float(ground[2]))
    await services.keep()  # whoever goes on with this flight must know the way home
    try:
        if not autopilot.telemetry.armed:
            await autopilot.arm()
        await autopilot.take_off(parameters.height_m)
        if not await _climbed(services, float(ground[2]), parameters.height_m):
            mode = autopilot.telemetry.flight_mode
            services.progress.text = f"the take-off was ended by somebody else: {mode}"
            services.raise_event("vehicle_failsafe", mode=mode)
            return "failed"
        pose = autopilot.telemetry.pose
        await services.setpoints.start(Setpoint(pose.position.copy(), float(pose.attitude[2])))
        await autopilot.take_gimbal()
    except AutopilotError as error:
        services.progress.text = str(error)
        services.log.warning("take_off", error=str(error))
        return "failed"
    return "done"


async def _climbed(services: Services, ground: float, height_m: float) -> bool:
    """Wait for the height over `ground` m, down in local NED; False if somebody else has ended the take-off before."""
    foreign_s = 0.0
    while True:
        telemetry = services.autopilot.telemetry
        climbed = ground - float(telemetry.pose.position[2])
        early = climbed < height_m - HOLDS_BELOW_M and services.commanded.obeyed
        foreign = not services.ours or (early and telemetry.flight_mode in ("HOLD", "LOITER"))
        if climbed >= height_m - 0.7 and not foreign:
            return True
        if foreign and foreign_s > REPORT_S * services.clock.speed:
            return False
        services.progress.text = f"{climbed:.1f} of {height_m:.0f} m"
        await services.clock.sleep(0.2)
        foreign_s = foreign_s + 0.2 if foreign else 0.0


async def _climb_on(services: Services, here: Setpoint, down: float) -> str:
    """The rest of a climb that was interrupted, to `down` m in local NED; never downward."""
    from flight.autopilot import AutopilotError

    above = here.position.copy()
    above[2] = min(down, float(here.position[2]))
    try:
        await services.setpoints.start(here)
        await services.autopilot.take_gimbal()
    except AutopilotError as error:
        services.progress.text = str(error)
        services.log.warning("take_off", error=str(error))
        return "failed"
    await fly_to(services, above, here.yaw, speed_m_s=CLIMB_M_S)
    return "done"
