"""What the live view shows at one instant, read from the executive without disturbing it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mission.executive.executive import Executive
    from mission.executive.status import Status


@dataclass(frozen=True)
class Next:
    """One transition that may come: its event, where it leads, and what holds it back (empty: the event alone)."""

    event: str
    target: str
    blocked_by: str = ""


@dataclass(frozen=True)
class Scene:
    """One instant of a run. Seconds, metres and degrees; None where nothing is known."""

    mission: str
    state: str
    now_s: float
    entered_s: float = 0.0
    deadline_s: float | None = None
    behaviour: str = ""
    doing: str = ""
    speed: float = 1.0
    simulated: bool = True
    paused: bool = False
    autonomy: str = "full"
    station_m: float | None = None
    root_m: float = 0.0
    tip_m: float = 0.0
    distance_m: float | None = None
    sigma_m: float | None = None
    target_m: float | None = None
    nearest_m: float | None = None
    vision_age_s: float | None = None
    vision_hz: float | None = None
    battery_percent: float | None = None
    wind_m_s: float | None = None
    wind_from_deg: float | None = None
    mode: str = ""
    height_m: float | None = None
    link_age_s: float | None = None
    recording: str = ""
    question: str | None = None
    alarms: tuple[str, ...] = ()
    following: tuple[Next, ...] = ()
    events: tuple[tuple[float, str], ...] = ()


class VisionRate:
    """Cycles of vision a mission second, over the last few seconds."""

    def __init__(self) -> None:
        self._seen: list[tuple[float, int]] = []

    def update(self, now_s: float, cycles: int) -> float | None:
        """Count on; None until two seconds were seen."""
        self._seen.append((now_s, cycles))
        self._seen = [(at, count) for at, count in self._seen if at >= now_s - 5.0]
        (first_s, first), (last_s, last) = self._seen[0], self._seen[-1]
        return (last - first) / (last_s - first_s) if last_s - first_s >= 2.0 else None


def take_scene(executive: Executive, rate: VisionRate) -> Scene:
    """The present instant. Called from the view's own thread: it only reads."""
    status, services = executive.status(), executive.services
    mission, telemetry = services.mission, services.autopilot.telemetry
    perception: Any = services.perception
    now = services.clock.now()
    vision_age_s = getattr(perception, "vision_age_s", None)
    estimate = _quietly(perception.estimate) if vision_age_s is not None else None
    state = mission.states.get(status.path)
    home = services.memory.home
    wind = telemetry.wind
    return Scene(
        mission=mission.name,
        state=status.path,
        now_s=now,
        entered_s=status.entered_s,
        deadline_s=status.deadline_s,
        behaviour=(state.do or "") if state is not None else "",
        doing=services.progress.text,
        speed=services.clock.speed,
        simulated=services.autopilot.simulated,
        paused=status.paused,
        autonomy=status.autonomy,
        station_m=services.progress.station_m,
        root_m=mission.turbine.root_radius_m,
        tip_m=mission.turbine.tip_radius_m,
        distance_m=estimate.distance_m if estimate is not None else None,
        sigma_m=estimate.distance_sigma_m if estimate is not None else None,
        target_m=getattr(state.parameters, "standoff_m", None) if state is not None else None,
        nearest_m=estimate.nearest_m if estimate is not None else None,
        vision_age_s=vision_age_s,
        vision_hz=rate.update(now, getattr(perception, "cycles", 0)),
        battery_percent=telemetry.battery_percent,
        wind_m_s=math.hypot(*wind) if wind is not None else None,
        wind_from_deg=math.degrees(math.atan2(-wind[1], -wind[0])) % 360 if wind is not None else None,
        mode=telemetry.flight_mode,
        height_m=(home[2] if home is not None else 0.0) - float(telemetry.pose.position[2]),
        link_age_s=telemetry.link_age_s,
        recording=getattr(perception, "side", None) or "",
        question=status.waiting,
        alarms=_alarms(status),
        following=tuple(Next(entry.event, entry.target, entry.blocked or "") for entry in status.next),
    )


def _alarms(status: Status) -> tuple[str, ...]:
    """What an operator must not miss."""
    told = (
        (status.let_go, "a pilot flies: this program sends nothing any more"),
        (status.interrupted, "interrupted: the mission ends as its abort path says"),
        (status.journal_error is not None, status.journal_error or ""),
    )
    return tuple(text for shown, text in told if shown)


def _quietly(estimate: Any) -> Any:
    """The estimate, or None: the view must not fail because the flight changed something under it."""
    try:
        return estimate()
    except Exception:
        return None
