"""Who flies: a pilot's sticks, the autopilot's own failsafe, or the setpoints of this program."""

from __future__ import annotations

from mission.executive.monitors.monitor import monitor
from mission.executive.snapshot import Snapshot

STICKS = frozenset(
    ("MANUAL", "STABILIZED", "ACRO", "RATTITUDE", "ALTCTL", "POSCTL", "POSITION_SLOW", "ALTITUDE_CRUISE")
)
"""Flight modes in which a person's hands move the vehicle, by PX4's names."""

OURS = frozenset(("OFFBOARD", "UNKNOWN", ""))


@monitor("pilot_took_over")
def pilot(snapshot: Snapshot) -> float | None:
    """The flight mode is one that only a pilot chooses. No waiting: the executive never fights for the aircraft."""
    return 1.0 if snapshot.was_ours and snapshot.telemetry.flight_mode in STICKS else -1.0


@monitor("vehicle_failsafe", persist_s=2.0, wall=True)
def failsafe(snapshot: Snapshot) -> float | None:
    """Setpoints are being sent, yet the autopilot has been flying something else for two seconds.

    The mode is reported up to a second late, and the autopilot itself takes up a stream that broke off for a moment.
    """
    if not snapshot.streaming:
        return -1.0
    mode = snapshot.telemetry.flight_mode
    return -1.0 if mode in OURS or mode in STICKS else 1.0
