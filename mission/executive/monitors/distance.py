"""How near the vehicle is to anything, and how well it keeps its distance."""

from __future__ import annotations

from mission.executive.monitors.monitor import monitor
from mission.executive.snapshot import Snapshot


@monitor("too_close", limit="clearance_m", persist_s=0.1, rearm=0.3)
def clearance(snapshot: Snapshot) -> float | None:
    """Nearest measured 3D point, tracked surface or range finder, whichever is least, against `clearance_m`.

    Twice in a row: a single false match is no reason to leave.
    """
    nearest = snapshot.clearance_m
    return None if nearest is None else snapshot.limits.clearance_m - nearest


@monitor("standoff_lost", limit="standoff_error_m", persist_s=2.0, rearm=0.2)
def standoff(snapshot: Snapshot) -> float | None:
    """Tracked distance to the nearest point of the blade against the distance that the running behaviour keeps."""
    if snapshot.standoff_m is None or snapshot.estimate is None:
        return None
    return abs(snapshot.estimate.nearest_m - snapshot.standoff_m) - snapshot.limits.standoff_error_m
