"""Who flies: a pilot's sticks, the autopilot's own failsafe, or the setpoints of this program."""

from __future__ import annotations

from mission.executive.commanded import UNSAID
from mission.executive.monitors.monitor import monitor
from mission.executive.snapshot import Snapshot

STICKS = frozenset(
    ("MANUAL", "STABILIZED", "ACRO", "RATTITUDE", "ALTCTL", "POSCTL", "POSITION_SLOW", "ALTITUDE_CRUISE")
)
"""Flight modes in which a person's hands move the vehicle, by PX4's names."""


@monitor("pilot_took_over")
def pilot(snapshot: Snapshot) -> float | None:
    """The flight mode is one that only a pilot chooses. No waiting: the executive never fights for the aircraft."""
    return 1.0 if snapshot.was_ours and snapshot.telemetry.flight_mode in STICKS else -1.0


@monitor("vehicle_failsafe", persist_s=1.5, wall=True)
def failsafe(snapshot: Snapshot) -> float | None:
    """The autopilot flies a mode that this program neither commanded nor led to, whether setpoints are sent or not.

    The mode is reported up to a second late, and the autopilot itself takes up a stream that broke off for a moment.
    """
    mode = snapshot.telemetry.flight_mode
    if snapshot.ours is None or mode in snapshot.ours or mode in UNSAID or mode in STICKS:
        return -1.0
    return 1.0
