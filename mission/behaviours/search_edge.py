"""The edge is gone: look for it where it was last."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import FRESH_S, approach, stay

if TYPE_CHECKING:
    from mission.executive.services import Services


class SearchEdge(Parameters):
    """Parameters of `search_edge`."""

    side: Literal["leading", "trailing"] = Field("leading", description="the edge that was lost")
    reach_m: float = Field(1.2, gt=0, le=4, description="how far to look to either side")
    back_m: float = Field(1.0, ge=0, le=4, description="how far to back off first: a wider view")
    speed_m_s: float = Field(0.4, gt=0, le=1, description="speed of the search")


@behaviour(
    outcomes={"found": "the edge is seen again", "not_found": "looked on both sides in vain"},
    parameters=SearchEdge,
    needs_vision=True,
)
async def search_edge(services: Services, parameters: SearchEdge) -> str:
    """Back off a little, then sweep across the blade, first to the side where the edge was seen last."""
    import numpy as np

    from flight.autopilot import Setpoint
    from flight.guidance.follow import LONGEST_TICK_S

    across = services.turbine.blade_frame().across
    outward = across if parameters.side == "leading" else -across
    depth = services.turbine.blade_frame().depth
    here = stay(services)
    base = here.position - depth * parameters.back_m
    services.perception.watch_blade(True)
    for offset in (0.0, parameters.reach_m, -parameters.reach_m, 0.0):
        goal, carrot, last = base + outward * offset, here.position.copy(), services.clock.now()
        arrived_s: float | None = None
        async for now in services.ticks():
            elapsed, last = min(now - last, LONGEST_TICK_S), now
            carrot = approach(carrot, goal, parameters.speed_m_s * elapsed)
            services.setpoints.target = Setpoint(carrot.copy(), here.yaw)
            services.autopilot.point_gimbal(here.yaw, 0.0)
            estimate = services.perception.estimate()
            side = None if estimate is None else getattr(estimate, parameters.side)
            if side is not None and estimate is not None and max(side.age_s, estimate.age_s) < FRESH_S:
                return "found"
            if np.linalg.norm(carrot - goal) < 0.01:
                arrived_s = now if arrived_s is None else arrived_s
                if now - arrived_s > 1.5:
                    break
        here = Setpoint(carrot, here.yaw)
    return "not_found"
