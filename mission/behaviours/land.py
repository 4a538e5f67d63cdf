"""Down, and disarmed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mission.behaviours.behaviour import NoParameters, behaviour

if TYPE_CHECKING:
    from mission.executive.services import Services

RETRY_S = 3.0
NOT_TO_ARM_IN = ("OFFBOARD", "LAND", "RTL")


@behaviour(outcomes={"landed": "on the ground and disarmed, or never this mission's to land"}, airborne=None)
async def land(services: Services, parameters: NoParameters) -> str:
    """Land where it is with the autopilot's own landing and wait until it has disarmed; ask again until obeyed.

    Once it was seen landing it is not asked again: who ends that landing wants the vehicle. Nor is a vehicle that
    somebody else flies; the monitors say so, and end this.
    """
    from flight.autopilot import AutopilotError

    autopilot, commanded = services.autopilot, services.commanded
    services.perception.watch_blade(False)
    if not commanded.took_over:
        services.log.warning("land", error="this mission neither armed nor flew the vehicle: it is left alone")
        return "landed"
    asked_s = float("-inf")
    while autopilot.telemetry.armed or autopilot.telemetry.in_air:
        now = services.clock.now()
        begun = autopilot.telemetry.flight_mode == "LAND" or (commanded.mode == "LAND" and commanded.obeyed)
        patience = RETRY_S * max(1.0, services.clock.speed / 2)
        if not begun and services.ours and now - asked_s >= patience:
            asked_s = now
            try:
                await autopilot.land()
                services.setpoints.stop()
            except AutopilotError as error:
                services.log.warning("land", error=str(error))
        services.progress.text = f"{-float(autopilot.telemetry.pose.position[2]):.1f} m above home"
        await services.clock.sleep(0.2)
    services.setpoints.stop()
    await leave_landed(services)
    return "landed"


async def leave_landed(services: Services) -> None:
    """Put it on hold: on the ground the autopilot is back in the mode it landed from, and refuses to arm in that."""
    from flight.autopilot import AutopilotError

    if services.autopilot.telemetry.flight_mode not in NOT_TO_ARM_IN:
        return
    try:
        await services.autopilot.hold()
    except AutopilotError as error:
        services.log.warning("left in a mode that cannot be armed in", error=str(error))
