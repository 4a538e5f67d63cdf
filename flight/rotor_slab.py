"""The disc that the rotor sweeps, as a slab between the coned faces of its blades: as surveyed, and near the vehicle as
measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flight.turbine import Turbine

LOCAL_M = 5.0  # the measured surface holds this far along the blade and fades out over as much again
BEND_PER_M = 0.05  # how much a blade may leave its tangent, metres a metre
TIP_HALF_DEPTH_M = 0.3  # half of what a twisted tip takes up from front to back


@dataclass(frozen=True)
class BladeSurface:
    """The measured front of the inspected blade in blade coordinates: depth = depth_m + slope (station − station_m)
    with its sigma, and how far it has replaced the survey: trust 0 to 1."""

    station_m: float
    depth_m: float
    slope: float
    sigma_m: float
    trust: float


@dataclass(frozen=True)
class RotorSlab:
    """turbine as believed; sigmas: how many standard deviations of its position and heading are added; surface: what
    was measured of the inspected blade."""

    turbine: Turbine
    sigmas: float
    surface: BladeSurface | None

    def outline(self) -> tuple[tuple[float, float], ...]:
        """The slab's outline as (along the rotor's axis, radius), from the faces in blade coordinates."""
        t, surface = self.turbine, self.surface
        tip = t.tip_radius_m + self.sigmas * t.hub_sigma_m
        stations = {0.0, tip}
        if surface is not None:
            near = (-2 * LOCAL_M, -LOCAL_M, 0.0, LOCAL_M, 2 * LOCAL_M)
            stations |= {s for s in (surface.station_m + offset for offset in near) if 0.0 < s < tip}
        front, back = [], []
        for station in sorted(stations):
            thick, unsure = self._half_depth(station), self._survey_sigma(station)
            face = self._face(station)
            front.append((face, station))
            back.append((max(thick + unsure, face + 2 * thick), station))
        cos, sin = np.cos(t.cone), np.sin(t.cone)
        outline = [*front, *reversed(back)]
        return tuple((float(d * cos - s * sin), float(max(s * cos + d * sin, 0.0))) for d, s in outline)

    def _face(self, station: float) -> float:
        """Depth of the slab's front at a station, in blade coordinates."""
        survey = -self._half_depth(station) - self._survey_sigma(station)
        surface = self.surface
        if surface is None:
            return survey
        away = abs(station - surface.station_m)
        share = surface.trust * float(np.clip(2.0 - away / LOCAL_M, 0.0, 1.0))
        unsure = self.sigmas * float(np.hypot(surface.sigma_m, BEND_PER_M * away))
        measured = surface.depth_m + surface.slope * (station - surface.station_m) - unsure
        if measured < survey and away <= LOCAL_M:
            return measured
        return share * measured + (1.0 - share) * survey

    def root_share(self) -> float:
        """How far the measured surface speaks for the hub: 1 beside the root and trusted, 0 away from it."""
        if self.surface is None:
            return 0.0
        return self.surface.trust * float(np.clip(2.0 - self.surface.station_m / LOCAL_M, 0.0, 1.0))

    def hub_depth(self) -> float:
        """Where the measured blade, extended to the hub, puts the hub's centre along the depth axis of the survey."""
        surface = self.surface
        if surface is None:
            return 0.0
        return surface.depth_m - surface.slope * surface.station_m + self._half_depth(surface.station_m)

    def _half_depth(self, station: float) -> float:
        t = self.turbine
        share = float(np.clip((station - t.root_radius_m) / (t.tip_radius_m - t.root_radius_m), 0.0, 1.0))
        return (1 - share) * t.root_diameter_m / 2 + share * TIP_HALF_DEPTH_M

    def _survey_sigma(self, station: float) -> float:
        t = self.turbine
        return self.sigmas * float(np.hypot(t.hub_sigma_m, t.heading_sigma * station))
