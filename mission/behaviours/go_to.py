"""To a place that the mission names, relative to where it took off."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import engage, fly_to, target_or_here

if TYPE_CHECKING:
    from mission.executive.services import Services


class GoTo(Parameters):
    """Parameters of `go_to`."""

    north_m: float = Field(0.0, ge=-1000, le=1000, description="north of the take-off point")
    east_m: float = Field(0.0, ge=-1000, le=1000, description="east of it")
    height_m: float = Field(10.0, ge=2, le=200, description="above it")
    heading_deg: float | None = Field(None, ge=-360, le=360, description="where to look; without it, unchanged")
    speed_m_s: float = Field(3.0, gt=0, le=10, description="speed on the way")


@behaviour(outcomes={"arrived": "at the place, nearly at rest"}, parameters=GoTo)
async def go_to(services: Services, parameters: GoTo) -> str:
    """Fly a straight line to a place relative to the take-off point. Needs no images."""
    import numpy as np

    if not await engage(services):
        return "arrived"
    home = np.array(services.memory.home or (0.0, 0.0, 0.0))
    place = home + np.array([parameters.north_m, parameters.east_m, -parameters.height_m])
    yaw = target_or_here(services).yaw if parameters.heading_deg is None else np.deg2rad(parameters.heading_deg)
    await fly_to(services, place, float(yaw), speed_m_s=parameters.speed_m_s)
    return "arrived"
