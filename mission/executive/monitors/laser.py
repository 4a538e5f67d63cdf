"""The laser: whether it does as it is told."""

from __future__ import annotations

from mission.executive.monitors.monitor import monitor
from mission.executive.snapshot import Snapshot


@monitor("laser_fault", persist_s=0.5, airborne=False)
def laser(snapshot: Snapshot) -> float | None:
    """The rig itself complains of its laser."""
    return -1.0 if snapshot.laser_fault is None else 1.0
