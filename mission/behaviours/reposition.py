"""Over to the other side of the blade."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import FRESH_S

if TYPE_CHECKING:
    from flight.guidance.follow import FollowCommand
    from mission.executive.services import Services
    from vision.estimate import BladeEstimate


class Reposition(Parameters):
    """Parameters of `reposition`."""

    side: Literal["leading", "trailing"] = Field("trailing", description="the edge to go to")
    standoff_m: float = Field(3.0, ge=2.5, le=8, description="distance to hold meanwhile")
    steady_s: float = Field(1.0, gt=0, le=10, description="how long the new edge must be held in view")


BRIDGE_S = 6.0  # an edge before a tower comes and goes: so long it may be carried by the tracker,
SURE_M = 0.15  # while it is known as well as this


@behaviour(
    outcomes={"in_position": "the other edge is in view and tracked"},
    parameters=Reposition,
    needs_vision=True,
)
async def reposition(services: Services, parameters: Reposition) -> str:
    """Shift across the blade until the other edge is held in view, never losing both (5.24 to 5.26)."""
    from mission.behaviours.following import Following

    following = Following(services, side=parameters.side, toward="root", standoff_m=parameters.standoff_m)

    def in_view(estimate: BladeEstimate, command: FollowCommand) -> bool:
        side = following.side(estimate)
        seen = side is not None and (side.age_s < FRESH_S or (side.age_s < BRIDGE_S and side.offset_sigma_m < SURE_M))
        services.progress.text = f"{parameters.side} edge {'in view' if seen else 'not in view yet'}"
        return seen

    await following.hold(in_view, parameters.steady_s)
    return "in_position"
