"""Down, and disarmed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flight.autopilot import AutopilotError
from mission.behaviours.behaviour import NoParameters, behaviour

if TYPE_CHECKING:
    from mission.executive.services import Services

RETRY_S = 3.0


@behaviour(outcomes={"landed": "on the ground and disarmed"}, airborne=None)
async def land(services: Services, parameters: NoParameters) -> str:
    """Land where it is with the autopilot's own landing and wait until it has disarmed; ask again until obeyed."""
    autopilot = services.autopilot
    services.perception.watch_blade(False)
    asked_s = -RETRY_S
    while autopilot.telemetry.armed or autopilot.telemetry.in_air:
        now = services.clock.now()
        if autopilot.telemetry.flight_mode != "LAND" and now - asked_s >= RETRY_S * max(1.0, services.clock.speed / 2):
            asked_s = now
            try:
                await autopilot.land()
                services.setpoints.stop()
            except AutopilotError as error:
                services.log.warning("land", error=str(error))
        services.progress.text = f"{-float(autopilot.telemetry.pose.position[2]):.1f} m above home"
        await services.clock.sleep(0.2)
    services.setpoints.stop()
    return "landed"
