"""From afar: where the turbine really stands and how its blades are parked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import fly_to, wrap

if TYPE_CHECKING:
    import numpy as np

    from mission.executive.perception import FarSight
    from mission.executive.services import Services


class SurveyTurbine(Parameters):
    """Parameters of `survey_turbine`."""

    distance_m: float = Field(
        64.0, ge=30, le=80, description="of the two far viewpoints, from the hub of a rotor of 40 m radius"
    )
    baseline_m: float = Field(24.0, ge=6, le=60, description="between these, to the side")
    near_m: float = Field(36.0, ge=30, le=60, description="distance of a third; it tells the compass's error apart")
    pictures: int = Field(4, ge=1, le=20, description="pictures at each viewpoint")
    speed_m_s: float = Field(6.0, gt=0, le=10, description="speed between the viewpoints")


USUAL_RADIUS_M = 40.0
SMALLEST = 0.45  # a small rotor is looked at from nearer, but never from beside it


@behaviour(
    outcomes={
        "found": "hub and blades located",
        "not_found": "no rotor in the pictures, or they contradict each other",
    },
    parameters=SurveyTurbine,
    needs_vision=True,
    laser=False,
)
async def survey_turbine(services: Services, parameters: SurveyTurbine) -> str:
    """Picture the rotor from several places in front of it, intersect the views, and correct what the survey said."""
    import numpy as np

    sights: list[FarSight] = []
    for place in _viewpoints(services, parameters):
        sight = services.turbine.hub - place
        yaw = float(np.arctan2(sight[1], sight[0]))
        services.progress.text = f"to viewpoint {len(sights) // parameters.pictures + 1} of 3"
        await fly_to(services, place, yaw, speed_m_s=parameters.speed_m_s, tolerance_m=1.0)
        for _ in range(parameters.pictures):
            found = await services.perception.far_view()
            hub = found.view.hub
            services.log.info(
                "far_view",
                t=round(services.clock.now(), 3),
                valid=found.view.valid,
                reasons=list(found.view.reasons),
                hub_px=None if hub is None else [round(float(v), 1) for v in hub],
                camera=[round(float(v), 3) for v in found.pose.position],
                axis=[round(float(v), 5) for v in found.pose.rotation[:, 0]],
            )
            if found.view.valid:
                sights.append(found)
            await services.clock.sleep(0.3)
    refined = await services.clock.work(services.locate, sights)
    if refined is None:
        services.progress.text = "the pictures do not agree on a rotor"
        return "not_found"
    shift = refined.hub - services.turbine.hub
    services.log.info(
        "survey",
        hub=[round(float(v), 2) for v in refined.hub],
        shift_m=round(float(np.linalg.norm(shift)), 2),
        azimuth_deg=round(float(np.degrees(refined.azimuth)), 2),
        azimuth_shift_deg=round(float(np.degrees(wrap(refined.azimuth - services.turbine.azimuth))), 2),
    )
    services.refine_turbine(refined)
    return "found"


def _viewpoints(services: Services, parameters: SurveyTurbine) -> list[np.ndarray]:
    """Places (3,) in local NED: two far ones on either side of the axis, then a near one on it."""
    import numpy as np

    turbine = services.turbine
    x, y, _ = turbine.axes()
    scale = min(1.0, max(SMALLEST, turbine.tip_radius_m / USUAL_RADIUS_M))
    front = turbine.hub - scale * parameters.distance_m * x
    far = [front + side * scale * parameters.baseline_m / 2 * y for side in (-1.0, 1.0)]
    here = services.autopilot.telemetry.pose.position
    far.sort(key=lambda place: float(np.linalg.norm(place - here)))
    return [*far, turbine.hub - scale * parameters.near_m * x]
