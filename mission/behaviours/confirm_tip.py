"""Is that really the tip?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import stay

if TYPE_CHECKING:
    from mission.executive.services import Services


class ConfirmTip(Parameters):
    """Parameters of `confirm_tip`."""

    side: Literal["leading", "trailing"] = Field("leading", description="the pass that ended here; goes on if rejected")
    sightings: int = Field(5, ge=2, le=30, description="agreeing sightings that are wanted")
    spread_m: float = Field(0.4, gt=0, le=2, description="how far they may lie from their median")
    length_error_m: float = Field(3.0, gt=0, description="how far from the turbine file's blade length the tip may lie")
    patience_s: float = Field(12.0, gt=0, description="after so long without agreement it is rejected")


@behaviour(
    outcomes={"confirmed": "the tip, at a station that fits the blade", "rejected": "not the tip, or not seen again"},
    parameters=ConfirmTip,
    needs_vision=True,
)
async def confirm_tip(services: Services, parameters: ConfirmTip) -> str:
    """Stop and look again: enough sightings must agree with each other and with the blade's length."""
    from vision.landmarks import agreed_tip

    stay(services)
    started = services.clock.now()
    while services.clock.now() - started < parameters.patience_s:
        await services.clock.sleep(0.2)
        station = agreed_tip(
            services.perception.tips, started, least=parameters.sightings, spread_m=parameters.spread_m
        )
        if station is None:
            continue
        expected = services.turbine.tip_radius_m
        services.progress.text = f"tip at {station:.2f} m, expected {expected:.1f} m"
        services.log.info("tip", station_m=round(station, 3), expected_m=expected)
        if abs(station - expected) > parameters.length_error_m:
            break
        services.memory.tip_station_m = station
        return "confirmed"
    services.memory.tip_station_m = None
    services.memory.passes_done[:] = [side for side in services.memory.passes_done if side != parameters.side]
    return "rejected"
