"""The turbine's axes: where its blades point, seen with a compass and a plumb line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight.turbine import Turbine

LEVEL = Turbine(hub=np.array([10.0, 20.0, -78.0]), heading=0.0, azimuth=0.0, tilt=0.0, cone=0.0)


@pytest.mark.parametrize(
    ("azimuth_deg", "span", "leading"),
    [
        (0, (0, 0, -1), (0, 1, 0)),
        (90, (0, 1, 0), (0, 0, 1)),
        (180, (0, 0, 1), (0, -1, 0)),
        (270, (0, -1, 0), (0, 0, -1)),
    ],
)
def test_azimuth_runs_clockwise_from_up_and_so_does_the_rotor(azimuth_deg, span, leading):
    """Heading north: the drone looks north, east is on its right. The blade at 90° points right, its leading side
    down."""
    frame = LEVEL.blade_frame(np.deg2rad(azimuth_deg))
    assert frame.span == pytest.approx(span, abs=1e-12)
    assert frame.across == pytest.approx(leading, abs=1e-12)
    assert frame.depth == pytest.approx((1, 0, 0), abs=1e-12)


def test_tilt_keeps_the_lower_blade_away_from_the_tower_and_cone_brings_all_forward():
    tilted = Turbine(hub=np.zeros(3), heading=0.0, azimuth=0.0, tilt=np.deg2rad(5), cone=0.0)
    assert tilted.blade_frame(0.0).span[0] == pytest.approx(np.sin(np.deg2rad(5)))
    assert tilted.blade_frame(np.pi).span[0] == pytest.approx(-np.sin(np.deg2rad(5)))
    coned = Turbine(hub=np.zeros(3), heading=0.0, azimuth=0.0, tilt=0.0, cone=np.deg2rad(2))
    for azimuth in coned.azimuths():
        assert coned.blade_frame(azimuth).span[0] == pytest.approx(-np.sin(np.deg2rad(2)))


@given(st.floats(-7, 7), st.floats(-7, 7), st.floats(0, 0.2), st.floats(-0.1, 0.2))
def test_blade_axes_are_orthonormal_and_right_handed(heading, azimuth, tilt, cone):
    frame = Turbine(np.zeros(3), heading, azimuth, tilt=tilt, cone=cone).blade_frame()
    assert np.allclose(frame.rotation @ frame.rotation.T, np.eye(3))
    assert np.allclose(np.cross(frame.span, frame.across), frame.depth)


@given(st.floats(-7, 7), st.lists(st.floats(-100, 100), min_size=3, max_size=3))
def test_turbine_coordinates_round_trip(heading, point):
    turbine = Turbine(np.array([1.0, 2.0, -78.0]), heading, 0.3)
    assert np.allclose(turbine.from_ned(turbine.to_ned(np.array(point))), point, atol=1e-9)


def test_the_survey_puts_the_hub_before_and_above_the_tower():
    turbine = Turbine.surveyed(
        north_m=60, east_m=10, heading=np.pi / 2, hub_height_m=78, overhang_m=4, blade_length_m=39, root_radius_m=1,
        azimuth=0.5, ground_m=2, cone=0.1,
    )  # fmt: skip
    assert turbine.hub == pytest.approx([60, 6, -80])
    assert (turbine.tip_radius_m, turbine.ground_z, turbine.cone) == (40, -2, 0.1)


def test_in_front_is_on_the_drones_side():
    assert LEVEL.in_front(20.0, 3.0) == pytest.approx([7, 20, -98])


def test_refining_changes_what_was_measured_and_nothing_else():
    refined = LEVEL.refined(heading=0.2, hub_sigma_m=0.3, azimuth=-np.pi / 2)
    assert (refined.heading, refined.hub_sigma_m) == (0.2, 0.3)
    assert refined.azimuth == pytest.approx(1.5 * np.pi)
    assert np.array_equal(refined.hub, LEVEL.hub)
    assert refined.tip_radius_m == LEVEL.tip_radius_m
