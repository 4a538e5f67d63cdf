"""What the autopilot reports of the vehicle and the world around it."""

from __future__ import annotations

import math

from mission.executive.monitors.monitor import monitor
from mission.executive.snapshot import Snapshot


@monitor("battery_low", limit="battery_percent", persist_s=2.0, rearm=5.0)
def battery(snapshot: Snapshot) -> float | None:
    """Charge against `battery_percent`; a dip under load does not count."""
    return _below(snapshot.telemetry.battery_percent, snapshot.limits.battery_percent)


@monitor("battery_critical", limit="battery_critical_percent", persist_s=1.0, rearm=5.0)
def battery_critical(snapshot: Snapshot) -> float | None:
    """Charge against `battery_critical_percent`."""
    return _below(snapshot.telemetry.battery_percent, snapshot.limits.battery_critical_percent)


@monitor("wind_high", limit="wind_m_s", persist_s=3.0, rearm=1.0)
def wind(snapshot: Snapshot) -> float | None:
    """Mean wind as the autopilot estimates it against `wind_m_s`; a gust does not count."""
    return None if snapshot.wind_m_s is None else snapshot.wind_m_s - snapshot.limits.wind_m_s


@monitor("link_lost", limit="link_s", restored="link_restored", airborne=False)
def link(snapshot: Snapshot) -> float | None:
    """Time since the autopilot was last heard against `link_s`; never before it was first heard."""
    if not math.isfinite(snapshot.telemetry.link_age_s):
        return None
    return snapshot.telemetry.link_age_s - snapshot.limits.link_s


@monitor("geofence_breached", limit="geofence_m", persist_s=0.5, rearm=2.0)
def geofence(snapshot: Snapshot) -> float | None:
    """Distance from home, across and above, against `geofence_m`."""
    if snapshot.home is None or snapshot.home_m is None:
        return None
    height = snapshot.home[2] - float(snapshot.telemetry.pose.position[2])
    return math.hypot(snapshot.home_m, height) - snapshot.limits.geofence_m


@monitor("gps_degraded", limit="position_sigma_m", persist_s=2.0, rearm=0.5)
def position(snapshot: Snapshot) -> float | None:
    """Uncertainty of the position, as the autopilot claims it, against `position_sigma_m`."""
    sigma = snapshot.telemetry.position_sigma_m
    return sigma - snapshot.limits.position_sigma_m if math.isfinite(sigma) else None


def _below(value: float, limit: float) -> float | None:
    return limit - value if math.isfinite(value) else None
