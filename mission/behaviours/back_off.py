"""The first reaction near a blade: stop, and go back the way one looks, away from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import engage, fly_to, line_of_sight, stay

if TYPE_CHECKING:
    from mission.executive.services import Services


class BackOff(Parameters):
    """Parameters of `back_off`."""

    distance_m: float = Field(8.0, ge=1, le=60, description="how far to go back, horizontally")
    speed_m_s: float = Field(2.0, gt=0, le=5, description="speed on the way back")


@behaviour(outcomes={"done": "back by the distance"}, parameters=BackOff)
async def back_off(services: Services, parameters: BackOff) -> str:
    """Stop, then fly back along the line of sight, away from the blade. Needs no images."""
    services.perception.record(None)
    if not await engage(services):
        return "done"
    here = stay(services)
    goal = here.position - line_of_sight(services) * parameters.distance_m
    await fly_to(services, goal, here.yaw, speed_m_s=parameters.speed_m_s, tolerance_m=1.0, gimbal_pitch=None)
    services.perception.watch_blade(False)
    return "done"
