"""Turn the camera until it looks squarely at the surface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import FRESH_S, wrap

if TYPE_CHECKING:
    from flight.guidance.follow import FollowCommand
    from mission.executive.services import Services
    from vision.estimate import BladeEstimate


class AlignGimbal(Parameters):
    """Parameters of `align_gimbal`."""

    side: Literal["leading", "trailing"] = Field("leading", description="the edge that will be followed")
    standoff_m: float = Field(3.0, ge=2.5, le=8, description="distance to hold meanwhile")
    tolerance_deg: float = Field(4.0, gt=0, le=20, description="gimbal error at which it counts as aligned")
    steady_s: float = Field(1.0, gt=0, le=10, description="for so long")


@behaviour(
    outcomes={"aligned": "the camera looks squarely at the blade, the edge in view"},
    parameters=AlignGimbal,
    needs_vision=True,
)
async def align_gimbal(services: Services, parameters: AlignGimbal) -> str:
    """Hold at the standoff, bring the edge into view, and point the gimbal along the surface's normal."""
    import numpy as np

    from mission.behaviours.following import Following

    following = Following(services, side=parameters.side, toward="tip", standoff_m=parameters.standoff_m)

    def squarely(estimate: BladeEstimate, command: FollowCommand) -> bool:
        pose = services.autopilot.telemetry.pose
        error = np.hypot(wrap(float(pose.gimbal[0]) - command.gimbal_yaw), pose.gimbal[1] - command.gimbal_pitch)
        side = following.side(estimate)
        seen = side is not None and side.age_s < FRESH_S
        services.progress.text = f"gimbal {np.degrees(error):.1f}° off, edge {'seen' if seen else 'not seen'}"
        return bool(seen and error < np.deg2rad(parameters.tolerance_deg) and estimate.age_s < FRESH_S)

    await following.hold(squarely, parameters.steady_s)
    return "aligned"
