"""Up along the tower, photographing it from bottom to top, without structured light."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import fly_to

if TYPE_CHECKING:
    import numpy as np

    from mission.executive.services import Services


class ClimbTower(Parameters):
    """Parameters of `climb_tower`."""

    distance_m: float = Field(9.0, ge=6, le=30, description="distance to the tower's surface, held by the range finder")
    bottom_m: float = Field(8.0, ge=4, le=100, description="height above home at which the climb begins")
    top_m: float = Field(28.0, ge=6, le=200, description="height above home at which it ends, below the rotor")
    spacing_m: float = Field(1.0, ge=0.2, le=10, description="climb between two photographs")
    speed_m_s: float = Field(0.8, gt=0, le=3, description="climbing speed")
    approach_m_s: float = Field(4.0, gt=0, le=8, description="speed on the way to the bottom")


CORRECTION_PER_S = 0.3  # share of the distance error that is taken back in a second
MOST_CORRECTION_M = 4.0  # a survey that is wrong by more is not corrected but ended


@behaviour(
    outcomes={
        "done": "photographed up to the top",
        "not_found": "the range finder meets no tower where it should stand",
    },
    parameters=ClimbTower,
)
async def climb_tower(services: Services, parameters: ClimbTower) -> str:
    """Fly in front of the tower and climb along it at a distance that the range finder holds. Needs no laser."""
    import numpy as np

    from flight.autopilot import Setpoint

    turbine = services.turbine
    home = np.array(services.memory.home or (0.0, 0.0, 0.0))
    ahead = turbine.axes()[0] * np.array([1.0, 1.0, 0.0])
    ahead /= np.linalg.norm(ahead)
    axis = turbine.hub + turbine.overhang_m * ahead
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    before = parameters.distance_m + turbine.tower_base_diameter_m / 2

    def place(height_m: float, correction_m: float) -> np.ndarray:
        spot = axis + (correction_m - before) * ahead
        return np.array([spot[0], spot[1], home[2] - height_m])

    services.perception.watch_blade(False)
    services.progress.text = "to the tower's foot"
    await fly_to(services, place(parameters.bottom_m, 0.0), yaw, speed_m_s=parameters.approach_m_s, tolerance_m=1.0)
    height, correction, photographed, met = parameters.bottom_m, 0.0, -np.inf, False
    last = services.clock.now()
    async for now in services.ticks():
        elapsed, last = now - last, now
        height = min(parameters.top_m, height + parameters.speed_m_s * elapsed)
        telemetry = services.autopilot.telemetry
        seen = telemetry.range_m if telemetry.range_age_s < 1.0 else None
        if seen is not None and seen < 2 * parameters.distance_m:
            met = True
            correction += (seen - parameters.distance_m) * min(1.0, CORRECTION_PER_S * elapsed)
            correction = float(np.clip(correction, -MOST_CORRECTION_M, MOST_CORRECTION_M))
        services.setpoints.target = Setpoint(place(height, correction), yaw)
        services.autopilot.point_gimbal(yaw, 0.0)
        services.progress.text = f"{height:.0f} of {parameters.top_m:.0f} m up the tower"
        reached = float(home[2] - telemetry.pose.position[2])
        if reached - photographed >= parameters.spacing_m and await services.perception.photograph("tower"):
            photographed = reached
        if height >= parameters.top_m and abs(reached - parameters.top_m) < 0.5:
            return "done" if met else "not_found"
    raise AssertionError("ticks never end")
