"""The turbine as the mission believes it: surveyed, then refined by what is seen, and always with its uncertainty.

Turbine axes W are level: x from the front through the hub to the back, y right as the drone sees it, z down; yawed by
`heading`. The rotor's axes are W pitched by the tilt, nose up; the cone leans the blades forward, toward the drone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import rotation_of
from vision.estimate import BladeFrame

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Turbine:
    """hub (3,) m in local NED with its standard deviation per axis; heading rad, the direction from front to back;
    azimuth rad of the inspected blade, clockwise from up as seen from the front. Radii are from the hub's centre,
    `ground_z` is the tower's foot in local NED (down, so negative above the origin), lengths in metres, angles in
    radians.
    """

    hub: Array
    heading: float
    azimuth: float
    hub_sigma_m: float = 2.0
    heading_sigma: float = np.deg2rad(5.0)
    azimuth_sigma: float = np.deg2rad(3.0)
    root_radius_m: float = 1.0
    tip_radius_m: float = 40.0
    root_diameter_m: float = 1.9
    max_chord_m: float = 3.5
    tip_chord_m: float = 0.5
    tilt: float = np.deg2rad(5.0)
    cone: float = np.deg2rad(2.0)
    overhang_m: float = 4.2
    tower_top_diameter_m: float = 2.3
    tower_base_diameter_m: float = 4.0
    nacelle_length_m: float = 10.0
    nacelle_width_m: float = 3.2
    ground_z: float = 0.0

    @classmethod
    def surveyed(
        cls,
        *,
        north_m: float,
        east_m: float,
        heading: float,
        hub_height_m: float,
        overhang_m: float,
        blade_length_m: float,
        root_radius_m: float,
        azimuth: float,
        ground_m: float = 0.0,
        **rest: float,
    ) -> Turbine:
        """From a site (tower's axis north and east of home, ground above home) and a turbine's dimensions.

        The hub's centre is `overhang_m` in front of the tower's axis, `hub_height_m` above the ground. `rest` are
        further fields by their names; lengths in metres, angles in radians.
        """
        front = -overhang_m * np.array([np.cos(heading), np.sin(heading), 0.0])
        return cls(
            hub=np.array([north_m, east_m, -ground_m - hub_height_m]) + front,
            heading=heading,
            azimuth=azimuth,
            root_radius_m=root_radius_m,
            tip_radius_m=root_radius_m + blade_length_m,
            overhang_m=overhang_m,
            ground_z=-ground_m,
            **rest,
        )

    @property
    def rotation(self) -> Array:
        """(3, 3): W axes to local NED; its columns are x, y and z of W."""
        return rotation_of(0.0, 0.0, self.heading)

    @property
    def rotor_rotation(self) -> Array:
        """(3, 3): rotor axes to local NED. Nose up: the axis from front to back points downward by the tilt."""
        return rotation_of(0.0, -self.tilt, self.heading)

    def axes(self) -> tuple[Array, Array, Array]:
        """Unit vectors (3,) x, y, z of W in local NED."""
        x, y, z = self.rotation.T
        return x, y, z

    def to_ned(self, points: Array) -> Array:
        """Points (n, 3) or (3,) of W in local NED."""
        result: Array = points @ self.rotation.T + self.hub
        return result

    def from_ned(self, points: Array) -> Array:
        """Points (n, 3) or (3,) of local NED in W."""
        result: Array = (points - self.hub) @ self.rotation
        return result

    def blade_frame(self, azimuth: float | None = None) -> BladeFrame:
        """Axes of the blade at an azimuth (radians; the inspected one's by default), cone and tilt included."""
        a = self.azimuth if azimuth is None else azimuth
        x, y, z = self.rotor_rotation.T
        radial = np.sin(a) * y - np.cos(a) * z
        return BladeFrame(
            origin=self.hub,
            span=np.cos(self.cone) * radial - np.sin(self.cone) * x,
            across=np.cos(a) * y + np.sin(a) * z,
            depth=np.cos(self.cone) * x + np.sin(self.cone) * radial,
        )

    def azimuths(self) -> tuple[float, float, float]:
        """Azimuths of the three blades, the inspected one first, each in [0, 2π)."""
        a, b, c = (float((self.azimuth + i * 2 * np.pi / 3) % (2 * np.pi)) for i in range(3))
        return a, b, c

    def in_front(self, station_m: float, distance_m: float, offset_m: float = 0.0) -> Array:
        """The point (3,) in local NED at `distance_m` before the inspected blade's axis at a station along it."""
        return self.blade_frame().to_ned(np.array([station_m, offset_m, -distance_m]))

    def refined(
        self,
        *,
        hub: Array | None = None,
        heading: float | None = None,
        azimuth: float | None = None,
        hub_sigma_m: float | None = None,
        heading_sigma: float | None = None,
        azimuth_sigma: float | None = None,
    ) -> Turbine:
        """The same turbine with what has been measured since; what is not given stays."""
        given = {
            "hub": None if hub is None else np.asarray(hub, float),
            "heading": heading,
            "azimuth": None if azimuth is None else float(azimuth % (2 * np.pi)),
            "hub_sigma_m": hub_sigma_m,
            "heading_sigma": heading_sigma,
            "azimuth_sigma": azimuth_sigma,
        }
        known: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
        return replace(self, **known)
