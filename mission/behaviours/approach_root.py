"""From the survey's distance to the blade, at its root or where it is to begin, slower the nearer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour
from mission.behaviours.motion import FRESH_S, approach, fly_to

if TYPE_CHECKING:
    import numpy as np

    from mission.executive.services import Memory, Services
    from vision.estimate import BladeEstimate


class ApproachRoot(Parameters):
    """Parameters of `approach_root`."""

    standoff_m: float = Field(3.0, ge=2.5, le=8, description="distance to the blade at the end")
    stage_m: float = Field(9.0, ge=6, le=20, description="distance at which the creeping begins")
    station_m: float = Field(4.0, ge=2, le=150, description="where along the blade, from the hub's centre")
    speed_m_s: float = Field(4.0, gt=0, le=8, description="speed to the staging point")
    creep_m_s: float = Field(0.6, gt=0, le=1.5, description="speed from there on")


OVERLAP_M = 1.5  # of a pass that goes on with what was flown of it before
TIP_MARGIN_M = 1.5  # so far inside the tip there is still enough blade to be found
INSIDE_M = 0.5  # from the edge, so that there is a surface to measure
SEEN_S = 1.0  # the blade must have been tracked without a break for so long before the approach relies on it


@behaviour(
    outcomes={"arrived": "in front of the root at the standoff", "not_found": "no blade where it should be"},
    parameters=ApproachRoot,
    needs_vision=True,
)
async def approach_root(services: Services, parameters: ApproachRoot) -> str:
    """Fly in front of the blade's root, then creep toward it until the blade is seen, measured and three metres away.

    In front of another station where `station_m` says so; and in front of where the inspection goes on, where it was
    interrupted before: a little before the end of the pass that was begun, or at the tip after the pass that led there.

    Until the cameras measure the blade, the range finder limits how near the vehicle goes.
    """
    import numpy as np

    from flight.autopilot import Setpoint
    from flight.guidance.follow import LONGEST_TICK_S

    turbine = services.turbine
    frame = turbine.blade_frame()
    ahead = turbine.axes()[0] * np.array([1.0, 1.0, 0.0])
    ahead /= np.linalg.norm(ahead)
    station, offset = goes_on_at(services.memory, parameters.station_m, turbine.tip_radius_m)
    root = frame.to_ned(np.array([station, offset, 0.0]))
    yaw = float(np.arctan2(ahead[1], ahead[0]))
    stage = root - ahead * (parameters.stage_m + 1.0)
    services.progress.text = "to the staging point"
    await fly_to(services, stage, yaw, speed_m_s=parameters.speed_m_s, tolerance_m=0.7)

    services.perception.watch_blade(True)
    nearest = root - ahead * (turbine.hub_sigma_m + 1.5)
    seen_since: float | None = None
    last = services.clock.now()
    carrot = stage.copy()
    async for now in services.ticks():
        elapsed, last = min(now - last, LONGEST_TICK_S), now
        estimate = services.perception.estimate()
        telemetry = services.autopilot.telemetry
        fresh = estimate is not None and estimate.age_s < FRESH_S and estimate.distance_sigma_m < 0.3
        seen_since = (seen_since if seen_since is not None else now) if fresh else None
        services.autopilot.point_gimbal(yaw, 0.0)
        if estimate is not None and services.setpoints.keep_out is not None:
            services.setpoints.keep_out = services.setpoints.keep_out.with_blade_surface(estimate, elapsed)
        if estimate is not None and seen_since is not None and now - seen_since >= SEEN_S:
            excess = _excess(estimate, telemetry.range_m, parameters.standoff_m)
            services.progress.text = f"blade at {estimate.nearest_m:.2f} m"
            services.progress.station_m = estimate.station_m
            goal = telemetry.pose.position + ahead * excess
            goal = goal + _centring(root, goal, ahead)
            carrot = _no_further(approach(carrot, goal, parameters.creep_m_s * elapsed), goal, ahead)
            if abs(excess) < 0.25 and np.linalg.norm(telemetry.pose.velocity) < 0.3:
                return "arrived"
        else:
            services.progress.text = "creeping toward the blade, not seen yet"
            room = np.inf if telemetry.range_m is None else telemetry.range_m - (parameters.standoff_m + 0.5)
            if room > 0:
                carrot = approach(carrot, nearest, parameters.creep_m_s * elapsed)
            else:
                carrot = _no_further(carrot, telemetry.pose.position + ahead * room, ahead)
            if np.linalg.norm(carrot - nearest) < 0.05 and np.linalg.norm(telemetry.pose.velocity) < 0.2:
                return "not_found"
        services.setpoints.target = Setpoint(carrot.copy(), yaw)
    raise AssertionError("ticks never end")


def goes_on_at(memory: Memory, root_m: float, tip_m: float) -> tuple[float, float]:
    """Station and offset (m, blade frame) at which the inspection goes on; at the root where it has yet to begin."""
    import numpy as np

    outermost = tip_m - TIP_MARGIN_M
    begun = [side for side in memory.inspected if side not in memory.passes_done]
    done = [side for side in memory.inspected if side in memory.passes_done]
    if not begun and (not done or len(done) > 1):
        return min(root_m, outermost), 0.0
    side = (begun or done)[-1]
    stretch = memory.inspected[side]
    travel = float(np.sign(stretch.to_m - stretch.from_m))
    station = stretch.to_m - (OVERLAP_M * travel if begun else 0.0)
    inward = -INSIDE_M if side == "leading" else INSIDE_M
    return float(np.clip(station, min(root_m, outermost), outermost)), stretch.edge_m + inward


def _excess(estimate: BladeEstimate, range_m: float | None, standoff_m: float) -> float:
    """How much too far away the vehicle is, by whatever is nearest."""
    nearest = estimate.nearest_m if range_m is None else min(estimate.nearest_m, range_m + 0.15)
    return nearest - standoff_m


def _no_further(carrot: np.ndarray, goal: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """The carrot (3,), but not nearer to the blade than the goal."""
    result: np.ndarray = carrot - max(0.0, float((carrot - goal) @ ahead)) * ahead
    return result


def _centring(root: np.ndarray, goal: np.ndarray, ahead: np.ndarray) -> np.ndarray:
    """Sideways and vertical way (3,) from the goal to the line of approach through the root."""
    off = root - goal
    result: np.ndarray = off - (off @ ahead) * ahead
    return result
