"""Vision went silent for longer than the tracker may bridge: stop, make room, wait for it to come back."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import FRESH_S, line_of_sight, stay

if TYPE_CHECKING:
    from mission.executive.services import Services


class ReacquireBlade(Parameters):
    """Parameters of `reacquire_blade`."""

    back_m: float = Field(1.0, ge=0, le=5, description="how far to back off along the line of sight")
    patience_s: float = Field(8.0, gt=0, le=60, description="how long to wait for images")
    steady_s: float = Field(1.0, gt=0, le=10, description="how long the blade must be seen again")


@behaviour(
    outcomes={"reacquired": "the blade is tracked again", "not_found": "it did not come back"},
    parameters=ReacquireBlade,
    laser=True,
)
async def reacquire_blade(services: Services, parameters: ReacquireBlade) -> str:
    """Stop, back off a little along the line of sight, and wait until the blade has been tracked again for a while."""
    from flight.autopilot import Setpoint

    here = stay(services)
    services.perception.watch_blade(True)
    services.setpoints.target = Setpoint(here.position - line_of_sight(services) * parameters.back_m, here.yaw)
    started, seen_s = services.clock.now(), None
    async for now in services.ticks(10.0):
        estimate = services.perception.estimate()
        fresh = estimate is not None and estimate.age_s < FRESH_S
        seen_s = (seen_s if seen_s is not None else now) if fresh else None
        if seen_s is not None and now - seen_s >= parameters.steady_s:
            return "reacquired"
        if seen_s is None and now - started > parameters.patience_s:
            return "not_found"
    raise AssertionError("ticks never end")
