"""Out of the rotor's reach before going home."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import engage, fly_to, line_of_sight, target_or_here

if TYPE_CHECKING:
    from mission.executive.services import Services


class ClimbClear(Parameters):
    """Parameters of `climb_clear`."""

    margin_m: float = Field(10.0, ge=2, le=50, description="room above the highest point of the rotor")
    speed_m_s: float = Field(3.0, gt=0, le=6, description="climbing speed")


@behaviour(outcomes={"done": "the straight way home is free"}, parameters=ClimbClear)
async def climb_clear(services: Services, parameters: ClimbClear) -> str:
    """Climb above the rotor, further from it first, if the straight way home would pass through the keep-out volume."""
    import numpy as np

    if not await engage(services):
        return "done"
    home = np.array(services.memory.home or (0.0, 0.0, 0.0))
    here = target_or_here(services)
    over_home = np.array([home[0], home[1], here.position[2]])
    if services.setpoints.keep_out is None or services.setpoints.keep_out.path_clear(here.position, over_home):
        return "done"
    top = services.turbine.hub[2] - services.turbine.tip_radius_m - parameters.margin_m
    away = here.position - line_of_sight(services) * 8.0
    await fly_to(services, away, here.yaw, speed_m_s=parameters.speed_m_s, tolerance_m=1.5)
    above = np.array([away[0], away[1], min(top, away[2])])
    await fly_to(services, above, here.yaw, speed_m_s=parameters.speed_m_s, tolerance_m=1.5)
    return "done"
