"""Where the vehicle flew, drawn beside the turbine as it was found: from the front, and from above."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from mission.record.history import RunHistory

WIDTH, HEIGHT = 470, 400
Point = tuple[float, float]


@dataclass(frozen=True)
class Stand:
    """The turbine for the eye. hub: north, east, height above home in metres; angles in radians."""

    hub: tuple[float, float, float]
    heading: float
    azimuth: float
    tip_m: float
    blades: int
    ground_m: float

    def seen_from(self, north: float, east: float) -> Point:
        """Metres beyond the rotor plane, and to the right as one looks at the turbine from the front."""
        n, e = north - self.hub[0], east - self.hub[1]
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return cos * n + sin * e, cos * e - sin * n

    def tips(self) -> list[Point]:
        """Right and height of each blade's tip, the inspected one first."""
        angles = [self.azimuth + 2 * math.pi * blade / self.blades for blade in range(self.blades)]
        return [(self.tip_m * math.sin(angle), self.hub[2] + self.tip_m * math.cos(angle)) for angle in angles]


def stand_of(history: RunHistory) -> Stand | None:
    """The turbine as the survey found it, or as the files have it; None where neither says."""
    turbine, site, memory = history.mission.get("turbine") or {}, history.mission.get("site") or {}, history.memory
    try:
        tip_m, blades = turbine["root_radius_m"] + turbine["blade_length_m"], int(turbine.get("blades", 3))
        ground_m = float(site.get("ground_m", 0.0))
        if memory.get("hub"):
            north, east, down = memory["hub"]
            return Stand((north, east, -down), memory["heading"], memory["azimuth"], tip_m, blades, ground_m)
        heading = math.radians(site["turbine_heading_deg"])
        ahead = turbine.get("overhang_m", 0.0)
        hub = (
            site["turbine_north_m"] - ahead * math.cos(heading),
            site["turbine_east_m"] - ahead * math.sin(heading),
            ground_m + turbine["hub_height_m"],
        )
        return Stand(hub, heading, math.radians(turbine.get("azimuth_deg", 0.0)), tip_m, blades, ground_m)
    except (KeyError, TypeError, ValueError):
        return None


def views(history: RunHistory) -> list[str]:
    """Two pictures as SVG, front and plan; none where too little is known."""
    stand, track = stand_of(history), _track(history)
    if stand is None or len(track) < 2:
        return []
    flown = [(*stand.seen_from(north, east), height) for north, east, height in track]
    return [_front(stand, flown), _plan(stand, flown)]


def _track(history: RunHistory) -> list[tuple[float, float, float]]:
    """North, east and height above home, twice a second."""
    track = []
    for row in history.telemetry[::5]:
        values: Any = [row.get(name) for name in ("north", "east", "down")]
        if all(values):
            track.append((float(values[0]), float(values[1]), -float(values[2])))
    return track


def _front(stand: Stand, flown: list[tuple[float, float, float]]) -> str:
    right, hub_m = stand.tip_m + 8, stand.hub[2]
    across = [-right, right, *(y for _, y, _ in flown)]
    up = [stand.ground_m, hub_m + right, *(height for *_, height in flown)]
    place = _placer(across, up)
    parts = [_line("ground", place((min(across), stand.ground_m)), place((max(across), stand.ground_m)))]
    parts.append(_line("tower", place((0.0, stand.ground_m)), place((0.0, hub_m))))
    inspected, *others = stand.tips()
    parts += [_line("other-blade", place((0.0, hub_m)), place(tip)) for tip in others]
    parts.append(_line("this-blade", place((0.0, hub_m)), place(inspected)))
    parts.append(_path([place((y, height)) for _, y, height in flown]))
    return _svg("from the front", parts)


def _plan(stand: Stand, flown: list[tuple[float, float, float]]) -> str:
    right = stand.tip_m + 8
    place = _placer([-right, right, *(y for _, y, _ in flown)], [15.0, *(x for x, _, _ in flown)])
    parts = [_line("other-blade", place((-stand.tip_m, 0.0)), place((stand.tip_m, 0.0)))]
    parts.append(_line("this-blade", place((0.0, 0.0)), place((stand.tips()[0][0], 0.0))))
    parts.append(_line("tower", place((0.0, 0.0)), place((0.0, 8.0))))
    parts.append(_path([place((y, x)) for x, y, _ in flown]))
    home = place((flown[0][1], flown[0][0]))
    parts.append(f'<circle class="home" cx="{home[0]:.1f}" cy="{home[1]:.1f}" r="4"/>')
    parts.append(f'<text x="{home[0] + 8:.1f}" y="{home[1] + 4:.1f}">home</text>')
    return _svg("from above", parts)


def _placer(across: list[float], up: list[float]) -> Any:
    """A function from metres to pixels, the same scale both ways."""
    scale = min((WIDTH - 30) / (max(across) - min(across)), (HEIGHT - 40) / (max(up) - min(up)))
    middle = (max(across) + min(across)) / 2

    def place(point: Point) -> Point:
        return WIDTH / 2 + scale * (point[0] - middle), HEIGHT - 12 - scale * (point[1] - min(up))

    return place


def _line(kind: str, start: Point, end: Point) -> str:
    return f'<line class="{kind}" x1="{start[0]:.1f}" y1="{start[1]:.1f}" x2="{end[0]:.1f}" y2="{end[1]:.1f}"/>'


def _path(points: list[Point]) -> str:
    return f'<polyline class="line" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}"/>'


def _svg(name: str, parts: list[str]) -> str:
    label = f'<text x="8" y="14">{name}</text>'
    return f'<svg class="view" viewBox="0 0 {WIDTH} {HEIGHT}" role="img">{label}{"".join(parts)}</svg>'
