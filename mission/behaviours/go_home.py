"""Back over the take-off point and down to where landing begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import engage, fly_to, target_or_here

if TYPE_CHECKING:
    from mission.executive.services import Services


class GoHome(Parameters):
    """Parameters of `go_home`."""

    speed_m_s: float = Field(5.0, gt=0, le=10, description="speed on the way")
    height_m: float = Field(8.0, ge=3, le=50, description="height over the take-off point at which this ends")


@behaviour(outcomes={"done": "over the take-off point, ready to land"}, parameters=GoHome)
async def go_home(services: Services, parameters: GoHome) -> str:
    """Fly to above the take-off point and descend: straight where the way is free. Needs no images."""
    import numpy as np

    services.perception.watch_blade(False)
    if not await engage(services):
        return "done"
    home = np.array(services.memory.home or (0.0, 0.0, 0.0))
    here = target_or_here(services)
    above = np.array([home[0], home[1], home[2] - parameters.height_m])
    keep_out = services.setpoints.keep_out
    if keep_out is not None and not keep_out.path_clear(here.position, above):
        level = np.array([home[0], home[1], min(here.position[2], above[2])])
        await fly_to(services, level, here.yaw, speed_m_s=parameters.speed_m_s, tolerance_m=1.5)
    await fly_to(services, above, here.yaw, speed_m_s=parameters.speed_m_s, tolerance_m=1.0)
    return "done"
