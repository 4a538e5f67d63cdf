"""The volume that no setpoint may enter: rotor, hub, nacelle and tower, grown by a clearance and by what is not known.

The rotor counts as the whole disc that it sweeps: a slab between the coned, tilted faces of the blades. While the eye
follows the inspected blade, its measured surface replaces the survey's there (`with_blade_surface`), since a survey
that is off by metres would either forbid a standoff of three metres or allow a collision.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot

import numpy as np
from numpy.typing import NDArray

from flight.rotor_slab import BladeSurface, RotorSlab
from flight.solids import Ball, Box, Point, Revolved, Solid
from flight.turbine import Turbine
from vision.estimate import BladeEstimate

Array = NDArray[np.float64]

MARGIN_M = 1e-3  # bounded points lie this far outside, so that rounding does not put them inside
TRUST_S = 3.0  # seconds of good measurement until the measured surface has wholly replaced the survey's
DISTRUST_S = 20.0  # seconds without it until the survey's is back: longer than any bridge, shorter than GPS drift
RETREAT_M_S = 0.5  # how fast a trusted surface may move away from the vehicle
TRUSTED_SIGMA_M = 0.3  # a distance less certain than this opens nothing
TRUSTED_AGE_S = 1.0
ROOT_SIGMA_M = 0.5  # of the hub beside a measured root: only its place along the blade is still the survey's


@dataclass(frozen=True)
class KeepOut:
    """turbine as believed; clearance_m from any of its surfaces to the vehicle's reference point; sigmas: how many
    standard deviations of the turbine's position and heading are added."""

    turbine: Turbine
    clearance_m: float = 2.0
    sigmas: float = 1.0
    surface: BladeSurface | None = None

    def distance(self, point: Array) -> float:
        """Metres from a point (3,) of local NED to the volume; negative inside."""
        return self._distance(_floats(point))

    def inside(self, point: Array) -> bool:
        """Whether a point (3,) of local NED lies in the volume."""
        return self.distance(point) < 0

    def path_clear(self, start: Array, end: Array) -> bool:
        """Whether the straight way between two points (3,) of local NED stays out of the volume."""
        return self._way(np.asarray(start, float), np.asarray(end, float), 0.0) is None

    def bound(self, position: Array, current: Array) -> tuple[Array, bool]:
        """The point to fly to instead of `position` (3,), and whether it differs.

        It is allowed, reached straight from `current` without entering the volume, and as near to `position` as sliding
        along the volume's surface brings it. A vehicle inside is never held there: it may go anywhere that does not
        lead deeper, and is otherwise sent out the shortest way, or to the front. Where either point is not finite, it
        is `current`: stay. If that is the one, nobody knows what lies on the way, and no other answer is safe.
        """
        position, current = np.asarray(position, float), np.asarray(current, float)
        if not (np.isfinite(position).all() and np.isfinite(current).all()):
            return current, True
        depth = min(0.0, self.distance(current))

        def reachable(point: Array) -> bool:
            return not self.inside(point) and self._way(current, point, depth) is None

        if reachable(position):
            return position, False
        candidates = [self._pushed(position), self._to_the_front(position), self._slid(position, current)]
        allowed = [point for point in candidates if reachable(point)]
        if allowed:
            return min(allowed, key=lambda point: float(np.linalg.norm(point - position))), True
        if depth < 0:
            return next(
                (p for p in (self._pushed(current), self._to_the_front(current)) if reachable(p)),
                self._to_the_front(current),
            ), True
        return self._stopped(position, current), True

    def with_turbine(self, turbine: Turbine) -> KeepOut:
        """The volume around a refined turbine; what was measured of the blade's surface in the old frame is
        forgotten."""
        return replace(self, turbine=turbine, surface=None)

    def with_blade_surface(self, estimate: BladeEstimate, elapsed_s: float) -> KeepOut:
        """The volume with the inspected blade's measured surface, `elapsed_s` after the last call; call it at every
        tick.

        A blade that is nearer than surveyed counts at once. One that is farther opens the way only as trust grows: over
        three seconds of certain, recent estimates, and then at a limited speed, so that no single wrong distance moves
        the vehicle into the blade. Trust fades over twenty seconds without such estimates, and the last surface keeps
        its place meanwhile.
        """
        old = self.surface
        certain = estimate.age_s <= TRUSTED_AGE_S and estimate.distance_sigma_m <= TRUSTED_SIGMA_M
        if not certain:
            if old is None:
                return self
            faded = old.trust - elapsed_s / DISTRUST_S
            return replace(self, surface=replace(old, trust=faded) if faded > 0 else None)
        frame = self.turbine.blade_frame()
        station, _, depth = (float(v) for v in frame.to_blade(estimate.point))
        along, _, inward = (float(v) for v in frame.rotation @ estimate.normal)
        depth += min(0.0, estimate.nearest_m - estimate.distance_m)
        if old is not None:
            depth = min(depth, old.depth_m + old.slope * (station - old.station_m) + RETREAT_M_S * elapsed_s)
        trust = min(1.0, (old.trust if old else 0.0) + elapsed_s / TRUST_S)
        surface = BladeSurface(station, depth, -along / inward, estimate.distance_sigma_m, trust)
        return replace(self, surface=surface)

    def without_blade_surface(self) -> KeepOut:
        """The survey's volume again, as after leaving the blade."""
        return replace(self, surface=None)

    @cached_property
    def _solids(self) -> tuple[Solid, ...]:
        t = self.turbine
        grown = self.clearance_m + self.sigmas * t.hub_sigma_m
        rotor = RotorSlab(t, self.sigmas, self.surface)
        root = rotor.root_share()
        hub = t.hub + root * rotor.hub_depth() * t.blade_frame().depth
        known = min(t.hub_sigma_m, ROOT_SIGMA_M)
        grown_hub = self.clearance_m + self.sigmas * (root * known + (1.0 - root) * t.hub_sigma_m)
        x, _, z = t.axes()
        hub_radius = max(t.root_diameter_m, t.root_radius_m + 0.5)
        tower_axis = t.hub + t.overhang_m * x
        height = t.ground_z - t.hub[2]
        tower = ((0.0, 0.0), (0.0, t.tower_top_diameter_m / 2), (height, t.tower_base_diameter_m / 2), (height, 0.0))
        nacelle = np.array([(hub_radius + t.nacelle_length_m) / 2, t.nacelle_width_m / 2, 0.6 * t.nacelle_width_m])
        return (
            Revolved(t.hub, t.rotor_rotation[:, 0], rotor.outline(), self.clearance_m),
            Ball(hub, hub_radius + grown_hub),
            Revolved(tower_axis, z, tower, grown),
            Box(hub + (hub_radius + t.nacelle_length_m) / 2 * x, t.rotation, nacelle, grown_hub),
        )

    def _distance(self, point: Point) -> float:
        return min([solid.distance(point) for solid in self._solids])

    def _normal(self, point: Array) -> Array:
        """The unit direction (3,) of the steepest growth of the distance."""
        at = _floats(point)
        return min(self._solids, key=lambda solid: solid.distance(at)).normal(at)

    def _way(self, start: Array, end: Array, least: float) -> float | None:
        """The share of the way at which the distance falls below `least`, or None. Steps are as long as the distance
        allows; the shortest, 5 cm, cannot cut a corner that is rounded by the clearance by more than a fraction of a
        millimetre."""
        (x, y, z), (u, v, w) = _floats(start), _floats(end - start)
        length = hypot(u, v, w)
        along = 0.0
        while along <= length:
            share = along / length if length else 1.0
            distance = self._distance((x + share * u, y + share * v, z + share * w)) - least
            if distance < -1e-6:
                return share
            along += max(distance, 0.05)
        return None

    def _pushed(self, point: Array) -> Array:
        """The nearest allowed point: along the steepest growth of the distance, again where solids meet."""
        for _ in range(30):
            distance = self.distance(point)
            if distance >= 0:
                return point
            point = point + (MARGIN_M - distance) * self._normal(point)
        return point

    def _to_the_front(self, point: Array) -> Array:
        """The first allowed point on the way to the front, along the rotor's axis."""
        forward = -self.turbine.rotor_rotation[:, 0]
        for _ in range(1000):
            distance = self.distance(point)
            if distance >= 0:
                return point
            point = point + max(-distance, 0.02) * forward
        return point

    def _slid(self, position: Array, current: Array) -> Array:
        """`position` moved onto the tangent plane of the surface where the way meets it, again until the way is
        clear."""
        for _ in range(8):
            share = self._way(current, position, 0.0)
            if share is None:
                break
            met = current + share * (position - current)
            direction = self._normal(met)
            met = met + (MARGIN_M - self.distance(met)) * direction
            position = position + max(0.0, float((met - position) @ direction)) * direction
        return position

    def _stopped(self, position: Array, current: Array) -> Array:
        """The last point of the straight way before it enters the volume."""
        share = self._way(current, position, 0.0)
        if share is None:
            return current
        length = float(np.linalg.norm(position - current))
        while share > 0:
            point = current + share * (position - current)
            if not self.inside(point):
                return point
            share -= 0.05 / length
        return current


def _floats(point: Array) -> Point:
    x, y, z = np.asarray(point, float).tolist()
    return x, y, z
