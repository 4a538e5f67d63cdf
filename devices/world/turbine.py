"""The simulated turbine as it truly stands: dimensions, place, angles, its triangles, and where its edges truly are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.world.blade import Blade, TipShape
from devices.world.mesh import Mesh, Surface, disc, grid, joined
from devices.world.settings import SurveyError
from vision.capture import rotation_of
from vision.estimate import BladeFrame

Array = NDArray[np.float64]

SKY, TOWER, NACELLE, HUB, INSPECTED, SECOND, THIRD = range(7)  # parts; the inspected blade, then clockwise the others
BLADES = (INSPECTED, SECOND, THIRD)


@dataclass(frozen=True)
class TurbineShape:
    """A three-bladed turbine. north_m, east_m: the tower's axis in local NED; ground_m: its foot above home.

    heading_deg: from the front through the hub to the back, clockwise from north. azimuth_deg: of the inspected blade,
    clockwise as seen from the front, 0 = up. Blade coordinates are (station, offset, depth) as in `BladeFrame`.
    """

    north_m: float = 0.0
    east_m: float = 0.0
    heading_deg: float = 0.0
    ground_m: float = 0.0
    hub_height_m: float = 78.0
    blade_length_m: float = 39.0
    root_radius_m: float = 1.0
    root_diameter_m: float = 1.9
    max_chord_m: float = 3.5
    tip_chord_m: float = 0.5
    tip: TipShape = "round"
    tilt_deg: float = 5.0
    cone_deg: float = 2.0
    overhang_m: float = 4.2
    tower_top_diameter_m: float = 2.3
    tower_base_diameter_m: float = 4.0
    nacelle_length_m: float = 10.0
    nacelle_width_m: float = 3.2
    azimuth_deg: float = 45.0
    pitch_deg: float = 2.0

    @classmethod
    def of(cls, turbine: Mapping[str, Any], site: Mapping[str, Any], error: SurveyError | None = None) -> TurbineShape:
        """The true turbine: what a turbine file and a site file say, and the survey's error on top."""
        error = error or SurveyError()
        own = {field.name for field in fields(cls)}
        known = {name: value for name, value in turbine.items() if name in own and value is not None}
        bearing = np.deg2rad(error.bearing_deg)
        known["azimuth_deg"] = (known.get("azimuth_deg", cls.azimuth_deg) + error.azimuth_deg) % 360.0
        return cls(
            **known,
            north_m=site["turbine_north_m"] + error.distance_m * float(np.cos(bearing)),
            east_m=site["turbine_east_m"] + error.distance_m * float(np.sin(bearing)),
            heading_deg=site["turbine_heading_deg"] + error.heading_deg,
            ground_m=site.get("ground_m", 0.0),
        )

    @cached_property
    def blade(self) -> Blade:
        """One blade in its own coordinates; all three are alike."""
        return Blade(
            self.root_radius_m,
            self.blade_length_m,
            self.root_diameter_m,
            self.max_chord_m,
            self.tip_chord_m,
            float(np.deg2rad(self.pitch_deg)),
            self.tip,
        )

    @cached_property
    def rotation(self) -> Array:
        """(3, 3): turbine axes W to local NED."""
        return rotation_of(0.0, 0.0, np.deg2rad(self.heading_deg))

    @cached_property
    def hub(self) -> Array:
        """The hub's centre (3,) in local NED."""
        above = np.array([self.north_m, self.east_m, -self.ground_m - self.hub_height_m])
        hub: Array = above - self.overhang_m * self.rotation[:, 0]
        return hub

    @cached_property
    def rotor(self) -> Array:
        """(3, 3): rotor axes (x along the shaft to the back, y right, z down in the rotor's plane) to local NED."""
        return rotation_of(0.0, -np.deg2rad(self.tilt_deg), np.deg2rad(self.heading_deg))

    @property
    def spinner_radius_m(self) -> float:
        """Radius of the spinner where the blades leave it."""
        return self.root_radius_m + 0.55

    @property
    def visible_root_m(self) -> float:
        """Station at which the blade comes out of the spinner."""
        return self.spinner_radius_m

    def blade_frame(self, number: int = 0) -> BladeFrame:
        """Frame of blade 0 (inspected), 1 or 2 (next clockwise): exact, cone and tilt included."""
        azimuth = np.deg2rad(self.azimuth_deg + 120.0 * number)
        cone = np.deg2rad(self.cone_deg)
        x, y, z = self.rotor.T
        span, across = np.sin(azimuth) * y - np.cos(azimuth) * z, np.cos(azimuth) * y + np.sin(azimuth) * z
        return BladeFrame(
            self.hub, np.cos(cone) * span - np.sin(cone) * x, across, np.cos(cone) * x + np.sin(cone) * span
        )

    def edges(self, stations: Array, number: int = 0) -> tuple[Array, Array]:
        """Points (n, 3) in local NED of the leading and the trailing edge at stations (n,), as seen from the front."""
        leading, trailing = self.blade.edges(stations)
        frame = self.blade_frame(number)
        return frame.to_ned(leading), frame.to_ned(trailing)

    @cached_property
    def tip_point(self) -> Array:
        """The outermost point (3,) of the inspected blade in local NED."""
        end = self.blade.sections(np.array([self.blade.tip_radius_m]))[0]
        point: Array = self.blade_frame().to_ned(end.mean(axis=0))
        return point

    @cached_property
    def mesh(self) -> Mesh:
        """All triangles in local NED."""
        surfaces = [*self._tower(), *self._nacelle(), *self._spinner()]
        for number, part in enumerate(BLADES):
            surfaces += self._blade(number, part)
        return joined(surfaces)

    def _blade(self, number: int, part: int) -> list[Surface]:
        blade, frame = self.blade, self.blade_frame(number)
        outline = blade.sections(blade.stations)
        shape = outline.shape
        points = frame.to_ned(outline.reshape(-1, 3)).reshape(shape)
        skin = np.empty((*shape[:2], 2))
        skin[..., 0] = outline[..., 0] - self.root_radius_m
        skin[..., 1] = np.linspace(0, 1, shape[1])
        inside = points.mean(axis=1, keepdims=True)
        hull = grid(points, part, skin, closed=False, inside=inside)
        ends = points[:, [-1, 0]]
        strip = grid(ends, part, skin[:, [-1, 0]], closed=False, inside=inside)
        return [hull, strip, disc(points[-1], part, skin[-1], frame.span)]

    def _revolved(self, profile: Array, axis: Array, origin: Array, part: int, around: int) -> Surface:
        """profile (n, 2): metres along the axis (rotation column 0 of `axis`) and radius."""
        turn = np.linspace(0, 2 * np.pi, around + 1)
        along, radius = profile[:, 0, None], profile[:, 1, None]
        local = np.stack(np.broadcast_arrays(along, radius * np.cos(turn), radius * np.sin(turn)), axis=-1)
        inside = np.stack([profile[:, 0], 0 * profile[:, 0], 0 * profile[:, 0]], axis=-1)[:, None]
        skin = np.stack(np.broadcast_arrays(along, turn / (2 * np.pi)), axis=-1)
        return grid(local @ axis.T + origin, part, skin, closed=True, inside=inside @ axis.T + origin)

    def _tower(self) -> list[Surface]:
        foot = np.array([self.north_m, self.east_m, -self.ground_m])
        top = self.hub_height_m - 1.6
        height = np.linspace(0, top, 41)
        radius = np.interp(height, [0, top], [self.tower_base_diameter_m / 2, self.tower_top_diameter_m / 2])
        upward = np.column_stack([[0, 0, -1.0], [0, 1.0, 0], [1.0, 0, 0]])
        return [self._revolved(np.column_stack([height, radius]), upward, foot, TOWER, 96)]

    def _nacelle(self) -> list[Surface]:
        """A rounded box from behind the spinner to the back, widest in its middle."""
        start, end = 1.1, 1.1 + self.nacelle_length_m
        along = np.concatenate(
            [[start], np.linspace(start + 0.02, end - 0.6, 24), end - 0.6 + 0.6 * np.linspace(0.2, 1, 8)]
        )
        swell = np.ones_like(along)
        swell[:8] = np.linspace(0.86, 1.0, 8)
        tail = np.clip((along - (end - 0.6)) / 0.6, 0, 0.98)
        swell *= (1 - tail**3) ** (1 / 3)
        turn = np.linspace(0, 2 * np.pi, 65)
        power = 0.45
        wide = np.sign(np.cos(turn)) * np.abs(np.cos(turn)) ** power * self.nacelle_width_m / 2
        high = np.sign(np.sin(turn)) * np.abs(np.sin(turn)) ** power * self.nacelle_width_m * 0.55
        local = np.stack(
            np.broadcast_arrays(along[:, None], wide * swell[:, None], high * swell[:, None] - 0.1), axis=-1
        )
        inside = np.stack([along, 0 * along, 0 * along - 0.1], axis=-1)[:, None]
        skin = np.stack(np.broadcast_arrays(along[:, None], turn / (2 * np.pi)), axis=-1)
        place = self.rotation.T
        body = grid(local @ place + self.hub, NACELLE, skin, closed=True, inside=inside @ place + self.hub)
        front = disc(body.points[0], NACELLE, skin[0], -self.rotation[:, 0])
        return [body, front, disc(body.points[-1], NACELLE, skin[-1], self.rotation[:, 0])]

    def _spinner(self) -> list[Surface]:
        radius = self.spinner_radius_m
        turn = np.linspace(0.02, np.pi / 2, 20)
        nose = np.column_stack([-0.3 - 1.5 * np.cos(turn), radius * np.sin(turn)])
        rest = np.column_stack([np.linspace(-0.1, 1.25, 10), np.linspace(radius, radius * 0.9, 10)])
        body = self._revolved(np.concatenate([nose, rest]), self.rotor, self.hub, HUB, 72)
        flat = body.skin[0]
        return [
            body,
            disc(body.points[0], HUB, flat, -self.rotor[:, 0]),
            disc(body.points[-1], HUB, flat, self.rotor[:, 0]),
        ]
