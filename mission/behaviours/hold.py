"""Stay where it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import engage, stay

if TYPE_CHECKING:
    from mission.executive.services import Services


class Hold(Parameters):
    """Parameters of `hold`."""

    for_s: float | None = Field(None, gt=0, description="how long; without it, until an event ends the state")


@behaviour(outcomes={"done": "the time is over"}, parameters=Hold)
async def hold(services: Services, parameters: Hold) -> str:
    """Hold position, laser and recording off, for a time or until something else happens."""
    if not await engage(services):
        return "done"
    stay(services)
    services.perception.record(None)
    services.perception.watch_blade(False)
    if parameters.for_s is None:
        while True:
            await services.clock.sleep(60.0)
    await services.clock.sleep(parameters.for_s)
    return "done"
