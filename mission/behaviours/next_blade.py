"""On to the blade after the one that has been inspected."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import stay

if TYPE_CHECKING:
    from mission.executive.services import Services


class NextBlade(Parameters):
    """Parameters of `next_blade`."""

    blades: int = Field(3, ge=1, le=3, description="how many blades are to be inspected in all")


@behaviour(
    outcomes={"chosen": "another blade is the one to inspect now", "none_left": "all of them are done"},
    parameters=NextBlade,
)
async def next_blade(services: Services, parameters: NextBlade) -> str:
    """Choose the next blade clockwise: what is known of the hub holds for it, what was seen of the last does not."""
    import numpy as np

    stay(services)
    memory = services.memory
    services.perception.watch_blade(False)
    done = memory.values.get("blades_done", 0.0) + 1.0
    memory.values["blades_done"] = done
    services.progress.text = f"{done:.0f} of {parameters.blades} blades inspected"
    if done >= parameters.blades:
        return "none_left"
    services.perception.forget()
    memory.passes_done.clear()
    memory.inspected.clear()
    memory.tip_station_m = memory.root_station_m = None
    turbine = services.turbine
    services.refine_turbine(turbine.refined(azimuth=turbine.azimuth + 2 * np.pi / 3))
    services.log.info("next_blade", azimuth_deg=round(float(np.degrees(services.turbine.azimuth)), 1))
    return "chosen"
