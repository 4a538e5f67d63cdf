"""Along the blade on one of its sides, camera on the edge, until its end or a place before it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from mission.behaviours.behaviour import Parameters, behaviour

if TYPE_CHECKING:
    from mission.executive.services import Memory, Services
    from vision.estimate import BladeEstimate
    from vision.landmarks import RootWatch


class FollowEdge(Parameters):
    """Parameters of `follow_edge`."""

    side: Literal["leading", "trailing"] = Field(description="which edge")
    toward: Literal["tip", "root"] = Field(description="which way")
    standoff_m: float = Field(3.0, ge=2.5, le=8, description="distance to the nearest point of the blade")
    speed_m_s: float = Field(0.8, gt=0, le=2, description="speed along the blade")
    record: bool = Field(True, description="whether frames are kept for the inspector")
    until_m: float | None = Field(
        None,
        ge=2,
        le=150,
        description="station where it ends, from the hub's centre; without it, the blade's end",
    )


EDGE_PATIENCE_S = 8.0  # the wanted edge unseen for so long, though the blade is seen
TIP_WINDOW_S = 2.0
TIP_WITHIN_M = 4.0  # of where the turbine file has it: what looks like a tip elsewhere is dirt or another blade
PAST_TIP_M = 1.5  # beyond the expected tip nothing is followed
ROOT_MARGIN_M = 4.0  # the root's beginning is expected inside the root radius plus this
PROGRESS_STEP_M = 0.5
NEAREST_ROOT_M = 2.6  # never nearer to the hub's centre than this


@behaviour(
    outcomes={
        "tip_detected": "several sightings of a tip agree",
        "root_detected": "the chord has fallen and the position confirms the root",
        "edge_lost": "the blade is seen, the wanted edge is not; or the blade is longer than it should be",
        "station_reached": "the place that `until_m` names, before the blade's end",
    },
    only_with={"station_reached": "until_m"},
    parameters=FollowEdge,
    needs_vision=True,
    keeps_standoff=True,
)
async def follow_edge(services: Services, parameters: FollowEdge) -> str:
    """Follow the leading or trailing edge toward tip or root at the standoff, slower as the images grow old.

    On two edges where both fit into the view, on one where not, back over the edge where the camera has slipped off it.
    """
    import numpy as np

    from mission.behaviours.following import Following
    from vision.landmarks import RootWatch, agreed_tip

    perception = services.perception
    following = Following(
        services,
        side=parameters.side,
        toward=parameters.toward,
        standoff_m=parameters.standoff_m,
        speed_m_s=parameters.speed_m_s,
    )
    perception.record(parameters.side if parameters.record else None)
    root = RootWatch(services.turbine.root_radius_m + ROOT_MARGIN_M)
    started = services.clock.now()
    try:
        async for now in services.ticks():
            steered = following.tick(now)
            if steered is None:
                continue
            estimate, command = steered
            services.progress.text = f"{parameters.side} edge toward the {parameters.toward}, {command.mode}"
            side = following.side(estimate)
            if parameters.record and side is not None:
                note_progress(services.memory, parameters, estimate.station_m, side.offset_m)
            unseen_s = np.inf if side is None else side.age_s - estimate.age_s
            if now - started > EDGE_PATIENCE_S and unseen_s > EDGE_PATIENCE_S:
                return "edge_lost"
            if parameters.toward == "tip":
                tip = agreed_tip(perception.tips, max(started, now - TIP_WINDOW_S))
                if tip is not None and abs(tip - services.turbine.tip_radius_m) < TIP_WITHIN_M:
                    services.memory.tip_station_m = tip
                    done(services, parameters)
                    return "tip_detected"
                if estimate.station_m > services.turbine.tip_radius_m + PAST_TIP_M:
                    return "edge_lost"
            elif _at_root(services, root, estimate):
                done(services, parameters)
                return "root_detected"
            if reached(parameters, estimate.station_m):
                done(services, parameters)
                return "station_reached"
    finally:
        perception.record(None)
    raise AssertionError("ticks never end")


def reached(parameters: FollowEdge, station_m: float) -> bool:
    """Whether the pass has come as far as it was told to."""
    if parameters.until_m is None:
        return False
    return station_m >= parameters.until_m if parameters.toward == "tip" else station_m <= parameters.until_m


def done(services: Services, parameters: FollowEdge) -> None:
    """The pass has reached its end; one without photographs inspects nothing."""
    if parameters.record and parameters.side not in services.memory.passes_done:
        services.memory.passes_done.append(parameters.side)


def note_progress(memory: Memory, parameters: FollowEdge, station_m: float, edge_m: float) -> None:
    """Remember how far the pass has come, in steps; one that goes on in the same direction is the same pass."""
    from mission.executive.services import Stretch

    travel = 1.0 if parameters.toward == "tip" else -1.0
    before = memory.inspected.get(parameters.side)
    if before is None or (before.to_m - before.from_m) * travel < 0:
        memory.inspected[parameters.side] = Stretch(round(station_m, 2), round(station_m, 2), round(edge_m, 2))
    elif (station_m - before.to_m) * travel >= PROGRESS_STEP_M:
        memory.inspected[parameters.side] = Stretch(before.from_m, round(station_m, 2), round(edge_m, 2))


def _at_root(services: Services, root: RootWatch, estimate: BladeEstimate) -> bool:
    """Whether the way back ends here: the chord's fall near the hub, or, at the latest, the least radius."""
    fallen = root.update(estimate.station_m, services.perception.chord(estimate.station_m))
    if fallen is not None and estimate.station_m <= services.turbine.root_radius_m + ROOT_MARGIN_M - 1.5:
        services.memory.root_station_m = fallen
        services.log.info("root", station_m=round(fallen, 2), by="chord")
        return True
    if estimate.station_m <= NEAREST_ROOT_M:
        services.memory.root_station_m = estimate.station_m
        services.log.info("root", station_m=round(estimate.station_m, 2), by="radius")
        return True
    return False
