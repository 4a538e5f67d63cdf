"""Before anything turns: is the vehicle fit to fly beside a turbine?"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mission.behaviours.behaviour import NoParameters, behaviour
from mission.behaviours.land import leave_landed

if TYPE_CHECKING:
    from mission.executive.services import Services

MARGIN_PERCENT = 10.0  # a flight that begins at its limit would end at once


@behaviour(
    outcomes={"passed": "nothing speaks against flying", "failed": "a finding forbids it; the journal says which"},
    airborne=False,
)
async def check_vehicle(services: Services, parameters: NoParameters) -> str:
    """Check health, battery, failsafe parameters and the rig; refuse what would hurt beside a turbine.

    A vehicle that somebody else has armed, or flies, is refused too.
    """
    from flight.preflight import check

    autopilot, ours = services.autopilot, services.commanded.resumed
    if ours and not (autopilot.telemetry.armed or autopilot.telemetry.in_air):
        await leave_landed(services)  # its program was not there any more when it had landed
    while not (autopilot.telemetry.armable or autopilot.telemetry.armed or autopilot.telemetry.in_air):
        services.progress.text = "waiting until the vehicle can be armed"
        await services.clock.sleep(0.5)
    findings = await check(
        autopilot,
        battery_percent=services.mission.limits.battery_percent + MARGIN_PERCENT,
        speed=services.clock.speed,
        ours=ours,
    )
    for finding in findings:
        services.log.info("preflight", code=finding.code, level=finding.level, text=finding.text, remedy=finding.remedy)
    refusals = [finding for finding in findings if finding.level == "refuse"]
    services.progress.text = "; ".join(f"{f.text}: {f.remedy}" for f in refusals) or "fit to fly"
    return "failed" if refusals else "passed"
