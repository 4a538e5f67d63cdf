"""The keep-out volume: what it holds, that nothing bounded lies in it, and that nobody is trapped by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight.keepout import KeepOut
from flight.turbine import Turbine
from tests.flight.synthetic_blade import PointMass, SyntheticBlade, facing
from vision.capture import rotation_of

SURE = Turbine(np.array([60.0, 10.0, -78.0]), 0.4, 0.6, hub_sigma_m=0.0, heading_sigma=0.0)
UNSURE = replace(SURE, hub_sigma_m=1.5, heading_sigma=np.deg2rad(3))
VOLUME = KeepOut(UNSURE, clearance_m=2.0)
CLEAR_OF_SURE = KeepOut(SURE, clearance_m=2.0)
offset = st.lists(st.floats(-60, 60), min_size=3, max_size=3).map(np.array)


def blade_points(turbine: Turbine) -> np.ndarray:
    """Points of three tapered blades, on and around their axes."""
    points = []
    for azimuth in turbine.azimuths():
        for station in np.linspace(1, 40, 40):
            half = np.interp(station, [1, 40], [0.9, 0.15])
            depths = (-half, 0.0, half)
            points += [turbine.blade_frame(azimuth).to_ned(np.array([station, 0.0, depth])) for depth in depths]
    return np.array(points)


BLADES = blade_points(SURE)


def test_rotor_hub_nacelle_and_tower_are_inside():
    for point in BLADES:
        assert CLEAR_OF_SURE.inside(point)
    for x, z in [(0, 0), (5, 0), (9.5, 0), (4.2, 30), (4.2, 77)]:
        assert CLEAR_OF_SURE.inside(SURE.to_ned(np.array([x, 0.0, z])))


@given(offset)
@settings(max_examples=200, deadline=None)
def test_outside_means_at_least_the_clearance_from_every_blade(away):
    point = SURE.hub + away
    nearest = np.min(np.linalg.norm(BLADES - point, axis=1))
    if nearest < 2.0:
        assert CLEAR_OF_SURE.inside(point)


def test_three_metres_before_a_well_known_blade_is_allowed_and_before_a_poorly_known_one_is_not():
    for station in (4.0, 20.0, 39.0):
        assert not KeepOut(SURE, clearance_m=2.0).inside(SURE.in_front(station, 4.0))
        assert VOLUME.inside(SURE.in_front(station, 4.0))


@given(offset, offset)
@settings(max_examples=150, deadline=None)
def test_what_is_bounded_is_outside_reached_without_entering_and_not_bounded_again(wanted, start):
    position, current = UNSURE.hub + wanted, UNSURE.hub + start
    allowed, bounded = VOLUME.bound(position, current)
    assert not VOLUME.inside(allowed)
    assert bounded == (not np.array_equal(allowed, position))
    if not VOLUME.inside(current):
        for share in np.linspace(0, 1, 101):
            assert VOLUME.distance(current + share * (allowed - current)) > -2e-3
        again, bounded_again = VOLUME.bound(allowed, current)
        assert not bounded_again
        assert np.array_equal(again, allowed)


@given(offset, offset, st.floats(-3, 3), offset)
@settings(max_examples=40, deadline=None)
def test_bounding_does_not_depend_on_where_north_and_the_origin_are(wanted, start, turn, move):
    rotation = rotation_of(0, 0, turn)
    turned = KeepOut(replace(UNSURE, hub=rotation @ UNSURE.hub + move, heading=UNSURE.heading + turn,
                             ground_z=UNSURE.ground_z + move[2]))  # fmt: skip
    position, current = UNSURE.hub + wanted, UNSURE.hub + start
    assert turned.distance(rotation @ position + move) == pytest.approx(VOLUME.distance(position), abs=1e-6)
    there, _ = turned.bound(rotation @ position + move, rotation @ current + move)
    assert there == pytest.approx(rotation @ VOLUME.bound(position, current)[0] + move, abs=0.05)


@given(offset)
@settings(max_examples=60, deadline=None)
def test_a_vehicle_inside_is_sent_out(start):
    current = UNSURE.hub + start / 10
    for _ in range(20):
        if not VOLUME.inside(current):
            return
        target, _ = VOLUME.bound(UNSURE.hub, current)
        assert not VOLUME.inside(target)
        assert np.linalg.norm(target - current) > 0
        current = target
    raise AssertionError("still inside")


def test_a_vehicle_inside_may_go_away_as_it_wants():
    current = UNSURE.in_front(20.0, 4.0)
    away = UNSURE.in_front(20.0, 15.0)
    assert VOLUME.inside(current)
    assert VOLUME.bound(away, current) == (pytest.approx(away), False)


def test_a_target_in_the_rotor_becomes_the_point_before_it():
    current = UNSURE.in_front(20.0, 20.0)
    allowed, bounded = VOLUME.bound(UNSURE.in_front(20.0, 0.0), current)
    along, across, depth = UNSURE.blade_frame().to_blade(allowed)
    assert bounded
    assert (along, across) == pytest.approx((20.0, 0.0), abs=0.6)
    assert -8.0 < depth < -4.0


def test_home_behind_the_turbine_is_not_flown_to_through_it():
    front, behind = UNSURE.in_front(3.0, 20.0), UNSURE.to_ned(np.array([40.0, 0.0, 0.0]))
    assert not VOLUME.path_clear(front, behind)
    allowed, bounded = VOLUME.bound(behind, front)
    assert bounded
    assert VOLUME.path_clear(front, allowed)


class TestMeasuredSurface:
    """The survey is off by 1.5 m along the line of sight; the blade stands where the truth says."""

    believed = UNSURE
    true = replace(UNSURE, hub=UNSURE.hub + 1.5 * UNSURE.blade_frame().depth)
    nearer = replace(UNSURE, hub=UNSURE.hub - 2.5 * UNSURE.blade_frame().depth)

    def estimate(self, truth: Turbine, station: float, **changes):
        blade = SyntheticBlade(truth.blade_frame())
        vehicle = facing(blade, truth.heading, station, 6.0)
        seen = blade.estimate(0.0, vehicle.camera())
        frame = self.believed.blade_frame()
        depth = float(frame.to_blade(seen.point)[2])
        return replace(seen, station_m=station, depth_m=depth, **changes), vehicle

    def followed(self, truth: Turbine, station: float, seconds: float, **changes) -> KeepOut:
        volume = VOLUME
        estimate, _ = self.estimate(truth, station, **changes)
        for _ in range(round(seconds / 0.1)):
            volume = volume.with_blade_surface(estimate, 0.1)
        return volume

    @pytest.mark.parametrize("station", [4.0, 15.0, 38.0])
    def test_three_metres_are_allowed_once_the_surface_is_trusted(self, station):
        at = facing(SyntheticBlade(self.true.blade_frame()), self.true.heading, station, 3.0).position
        assert VOLUME.inside(at)
        volume = self.followed(self.true, station, 5.0)
        assert not volume.inside(at)
        assert volume.bound(at, at - 3 * self.true.blade_frame().depth)[1] is False

    @pytest.mark.parametrize("station", [4.0, 15.0, 38.0])
    def test_the_clearance_is_kept_from_the_true_surface(self, station):
        volume = self.followed(self.true, station, 5.0)
        blade = SyntheticBlade(self.true.blade_frame())
        near = facing(blade, self.true.heading, station, 1.8).position
        assert volume.inside(near)

    @pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
    def test_three_metres_are_allowed_at_either_side_of_a_twisted_chord(self, share):
        """Where one edge lies half a metre before the other, each side is followed at its own distance."""
        blade = SyntheticBlade(self.true.blade_frame())
        leading, trailing = blade.edges(9.0)
        offset = trailing + share * (leading - trailing)
        at = blade.frame.to_ned(np.array([9.0, offset, blade.depth(9.0, offset) - 3.15]))
        vehicle = PointMass(at, self.true.heading, np.array([self.true.heading, 0.0]))
        volume = VOLUME
        for _ in range(50):
            volume = volume.with_blade_surface(blade.estimate(0.0, vehicle.camera()), 0.1)
        assert not volume.inside(at)

    def test_trust_grows_slowly_and_never_from_uncertain_or_old_estimates(self):
        at = facing(SyntheticBlade(self.true.blade_frame()), self.true.heading, 15.0, 3.0).position
        assert self.followed(self.true, 15.0, 0.3).inside(at)
        assert self.followed(self.true, 15.0, 9.0, distance_sigma_m=0.5).inside(at)
        assert self.followed(self.true, 15.0, 9.0, age_s=2.0).inside(at)

    def test_one_wrong_distance_hardly_moves_a_trusted_surface(self):
        volume = self.followed(self.true, 15.0, 5.0)
        at = facing(SyntheticBlade(self.true.blade_frame()), self.true.heading, 15.0, 1.9).position
        estimate, _ = self.estimate(self.true, 15.0)
        wrong = replace(estimate, point=estimate.point + 2.0 * self.believed.blade_frame().depth)
        assert volume.inside(at)
        assert volume.with_blade_surface(wrong, 0.05).inside(at)

    def test_a_blade_nearer_than_surveyed_counts_at_once(self):
        at = facing(SyntheticBlade(self.nearer.blade_frame()), self.nearer.heading, 10.0, 1.5).position
        sure = KeepOut(replace(UNSURE, hub_sigma_m=0.3, heading_sigma=0.0))
        assert not sure.inside(at)
        estimate, _ = self.estimate(self.nearer, 10.0)
        assert sure.with_blade_surface(estimate, 0.05).inside(at)

    def test_trust_fades_when_vision_is_lost_but_outlasts_a_bridge(self):
        at = facing(SyntheticBlade(self.true.blade_frame()), self.true.heading, 15.0, 3.0).position
        volume = self.followed(self.true, 15.0, 5.0)
        lost, _ = self.estimate(self.true, 15.0, age_s=3.0)
        for _ in range(20):
            volume = volume.with_blade_surface(lost, 0.1)
        assert not volume.inside(at)
        for _ in range(200):
            volume = volume.with_blade_surface(lost, 0.1)
        assert volume.inside(at)
        assert volume.distance(at) == pytest.approx(VOLUME.distance(at))

    def test_far_along_the_blade_the_survey_still_holds(self):
        volume = self.followed(self.true, 8.0, 5.0)
        far = self.true.in_front(35.0, 3.9)
        assert volume.inside(far)

    @pytest.mark.parametrize("azimuth_deg", range(0, 360, 45))
    def test_the_whole_blade_may_be_followed_at_three_metres(self, azimuth_deg):
        """Neither hub nor tower nor the other blades' disc stand in the way, the blade before the tower included."""
        turbine = UNSURE.refined(hub_sigma_m=1.0, heading_sigma=np.deg2rad(1.5), azimuth=np.deg2rad(azimuth_deg))
        blade, volume = SyntheticBlade(turbine.blade_frame()), KeepOut(turbine)
        for station in (2.6, 5.0, 20.0, 40.0):
            vehicle = facing(blade, turbine.heading, station, 3.0)
            for _ in range(35):
                volume = volume.with_blade_surface(blade.estimate(0.0, vehicle.camera()), 0.1)
            assert volume.distance(vehicle.position) > 0.25


@pytest.mark.parametrize("unknown", ["vehicle", "target"])
def test_where_a_point_is_not_known_the_answer_is_to_stay(unknown):
    inside, nowhere, here = SURE.hub, np.array([np.nan, 0.0, -70.0]), np.array([20.0, 10.0, -70.0])
    current, wanted = (nowhere, inside) if unknown == "vehicle" else (here, nowhere)
    answer, bounded = VOLUME.bound(wanted, current)
    assert bounded
    np.testing.assert_array_equal(answer, current)
