"""Everything that monitors and guards may look at, at one instant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from mission.language.limits import Limits

if TYPE_CHECKING:
    from flight.autopilot import Telemetry
    from mission.executive.services import Memory, Services
    from vision.estimate import BladeEstimate
    from vision.observation import BladeObservation

T = TypeVar("T")
GROUND_M = 3.0  # lower than this over home, a range finder that looks ahead may meet the ground
FRESH_S = 0.6  # older measurements say nothing of what is near now


@dataclass(frozen=True)
class Snapshot:
    """One instant. now: mission seconds; entered_s: when the present state was entered. limits: the state's.

    needs_vision: the running behaviour cannot work without images. streaming: setpoints are being sent. vision_age_s:
    since the last accepted observation, or since the watch began; None while nobody watches. seen: something has been
    accepted since then. standoff_m: the distance to the blade that the running behaviour keeps. was_ours: since
    take-off the autopilot has flown in a mode that no pilot chose. ours: the flight modes that follow from this
    program's commands, None where it gave none. laser_fault: the rig's own complaint. home: where
    the flight began, local NED. side: whose frames are being recorded. speed: of mission
    time, in mission seconds per wall second.
    """

    now: float
    entered_s: float
    telemetry: Telemetry
    limits: Limits
    estimate: BladeEstimate | None = None
    observation: BladeObservation | None = None
    vision_age_s: float | None = None
    seen: bool = True
    needs_vision: bool = False
    streaming: bool = False
    standoff_m: float | None = None
    was_ours: bool = True
    ours: frozenset[str] | None = frozenset(("OFFBOARD",))
    home: tuple[float, float, float] | None = None
    laser_on: bool = False
    laser_fault: str | None = None
    side: str | None = None
    speed: float = 1.0

    @property
    def clearance_m(self) -> float | None:
        """The least distance that anything measured lately: 3D points, the tracked surface, the range finder."""
        found: list[float] = []
        seen = self.observation
        if seen is not None and seen.valid and seen.nearest_m is not None and self.now - seen.stamp_s <= FRESH_S:
            found.append(seen.nearest_m)
        if self.estimate is not None and self.estimate.age_s <= self.limits.vision_bridge_s:
            found.append(self.estimate.nearest_m)
        over_ground = self.height_m is None or self.height_m >= GROUND_M
        if over_ground and self.telemetry.range_m is not None and self.telemetry.range_age_s <= FRESH_S:
            found.append(self.telemetry.range_m)
        measured = [distance for distance in found if np.isfinite(distance)]
        return min(measured) if measured else None

    @property
    def height_m(self) -> float | None:
        """Above home."""
        if self.home is None:
            return None
        return _known(self.home[2] - float(self.telemetry.pose.position[2]))

    @property
    def home_m(self) -> float | None:
        """Horizontal distance from home."""
        if self.home is None:
            return None
        away = self.telemetry.pose.position[:2] - np.array(self.home[:2])
        return _known(float(np.hypot(*away)))

    @property
    def wind_m_s(self) -> float | None:
        """Mean wind, where the autopilot estimates it."""
        return None if self.telemetry.wind is None else _known(float(np.hypot(*self.telemetry.wind)))


def take(
    services: Services,
    *,
    entered_s: float,
    limits: Limits,
    needs_vision: bool = False,
    standoff_m: float | None = None,
    was_ours: bool = True,
) -> Snapshot:
    """The present instant."""
    perception = services.perception
    accepted_s = getattr(perception, "last_accepted_s", None)
    watched_s = getattr(perception, "watching_since_s", None)
    return Snapshot(
        now=services.clock.now(),
        entered_s=entered_s,
        telemetry=services.autopilot.telemetry,
        limits=limits,
        estimate=perception.estimate(),
        observation=perception.observation,
        vision_age_s=getattr(perception, "vision_age_s", None),
        seen=accepted_s is not None and (watched_s is None or accepted_s >= watched_s),
        needs_vision=needs_vision,
        streaming=services.streaming,
        ours=services.commanded.modes(streaming=services.streaming),
        speed=services.clock.speed,
        standoff_m=standoff_m,
        was_ours=was_ours,
        home=services.memory.home,
        laser_on=bool(getattr(perception, "watching", False)),
        laser_fault=getattr(services.rig, "laser_fault", None),
        side=getattr(perception, "side", None),
    )


def quantities(snapshot: Snapshot, memory: Memory, *, simulated: bool) -> Mapping[str, float | bool | None]:
    """The values of the language's guards (mission/language/quantities.py) at this instant; None is unknown."""
    telemetry, estimate = snapshot.telemetry, snapshot.estimate
    position = telemetry.pose.position
    height = None if snapshot.home is None else snapshot.home[2] - float(position[2])
    values: dict[str, float | bool | None] = {
        "battery_percent": telemetry.battery_percent,
        "station_m": None if estimate is None else estimate.station_m,
        "distance_m": None if estimate is None else estimate.distance_m,
        "sigma_m": None if estimate is None else estimate.distance_sigma_m,
        "vision_age_s": snapshot.vision_age_s,
        "clearance_m": snapshot.clearance_m,
        "range_m": telemetry.range_m,
        "wind_m_s": snapshot.wind_m_s,
        "height_m": height,
        "home_m": snapshot.home_m,
        "speed_m_s": float(np.linalg.norm(telemetry.pose.velocity)),
        "position_sigma_m": telemetry.position_sigma_m,
        "link_age_s": telemetry.link_age_s,
        "elapsed_s": snapshot.now,
        "in_state_s": snapshot.now - snapshot.entered_s,
        "armed": telemetry.armed,
        "in_air": telemetry.in_air,
        "laser_on": snapshot.laser_on,
        "recording": snapshot.side is not None,
        "simulated": simulated,
        "blade_seen": None if snapshot.observation is None else snapshot.observation.valid,
        "hub_known": memory.hub is not None,
        "tip_known": memory.tip_station_m is not None,
        "root_known": memory.root_station_m is not None,
        "pass_done(leading)": "leading" in memory.passes_done,
        "pass_done(trailing)": "trailing" in memory.passes_done,
    }
    return {name: _known(value) for name, value in values.items()}


def _known(value: T) -> T | None:
    return None if isinstance(value, float) and not np.isfinite(value) else value
