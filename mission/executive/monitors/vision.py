"""Whether the blade is still seen, well enough to fly by."""

from __future__ import annotations

from mission.executive.monitors.monitor import monitor
from mission.executive.snapshot import Snapshot

FIRST_SIGHT_S = 30.0  # how long a behaviour may look for a blade that it has not seen yet


@monitor("vision_lost", limit="vision_bridge_s", restored="vision_restored")
def vision(snapshot: Snapshot) -> float | None:
    """Time since the last accepted observation against `vision_bridge_s`, and the tracked distance's standard deviation
    against `vision_sigma_m`; only while a behaviour that needs vision watches the blade.

    What has not been seen yet since the watch began cannot be lost so soon.
    """
    if not snapshot.needs_vision or snapshot.vision_age_s is None:
        return -1.0
    patience = snapshot.limits.vision_bridge_s if snapshot.seen else FIRST_SIGHT_S
    age = min(snapshot.vision_age_s, snapshot.now - snapshot.entered_s) - patience
    if snapshot.estimate is None:
        return age
    return max(age, snapshot.estimate.distance_sigma_m - snapshot.limits.vision_sigma_m)
