"""The thesis's guidance equations against closed forms, and their indifference to how the image is turned."""

from __future__ import annotations

from math import atan, atan2, cos, hypot, inf, isclose, pi, sin, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flight.guidance.angles import circular_mean, difference, nearer_direction, wrap
from flight.guidance.heading import (
    heading_on_both,
    heading_on_one,
    heading_on_wrong_side,
    turn_of,
    velocity_along,
    weight_on_one,
)
from flight.guidance.pid import Pid, PidState
from flight.guidance.pointing import angles_of, axis_of, body_to_ned, camera_to_body, pd_angles, turn_toward
from flight.guidance.rooms import View, free_room, least_room, room_beyond_centre
from flight.guidance.steps import fixation_point, reposition_room, step_along, step_to_edge, step_to_other_side
from vision.camera import Camera

VIEW = View(612, 512, 616)
ROUND = View(500, 500, 616)
angle = st.floats(-20, 20)
turns = st.sampled_from([1, -1])


def same_direction(a: float, b: float, tolerance: float = 1e-9) -> bool:
    return hypot(cos(a) - cos(b), sin(a) - sin(b)) < tolerance


@given(angle)
def test_wrapping_keeps_the_direction(a):
    assert -pi < wrap(a) <= pi
    assert same_direction(wrap(a), a)


@given(angle, st.floats(-1.5, 1.5), angle)
def test_a_circular_mean_turns_with_its_directions(a, spread, turn):
    assert same_direction(circular_mean([a - spread, a + spread]), a)
    assert same_direction(circular_mean([a - spread + turn, a + spread + turn]), a + turn)


def test_directions_that_cancel_have_no_mean():
    with pytest.raises(ValueError, match="no mean"):
        circular_mean([0.0, pi])


@given(angle, angle)
def test_of_an_axis_the_nearer_direction_is_chosen(axis, toward):
    chosen = nearer_direction(axis, toward)
    assert abs(difference(chosen, toward)) <= pi / 2 + 1e-9
    assert isclose(abs(sin(chosen - axis)), 0, abs_tol=1e-9)


@given(angle, st.floats(-0.5, 0.5))
def test_heading_on_both_edges_is_their_mean_and_opposite_toward_the_root(blade, taper):
    out = heading_on_both((blade + taper, blade - taper))
    assert same_direction(out, blade)
    assert same_direction(heading_on_both((blade + taper, blade - taper), reverse=True), blade + pi)


@given(st.floats(0, 10), angle)
def test_velocity_along_a_blade_has_its_direction_and_size(speed, omega):
    v, w = velocity_along(speed, omega)
    assert isclose(hypot(v, w), speed, abs_tol=1e-9)
    assert same_direction(atan2(w, v), omega) or speed < 1e-9


@pytest.mark.parametrize(("theta", "reach"), [(0, 306), (pi / 2, 256), (pi, 306), (pi / 4, hypot(306, 256) / 2**0.5)])
def test_rooms_are_measured_to_the_ellipse_in_the_image(theta, reach):
    assert free_room(VIEW, theta, 100) == pytest.approx(reach - 100)
    assert least_room(VIEW, theta, 0.25) == pytest.approx(reach / 4)
    assert room_beyond_centre(VIEW, theta, 100) == pytest.approx(reach + 100)


@given(st.floats(0, 2 * pi))
def test_reach_is_the_farthest_point_of_the_inscribed_ellipse(theta):
    t = np.linspace(0, 2 * pi, 20001)
    farthest = np.max(306 * np.cos(t) * cos(theta) + 256 * np.sin(t) * sin(theta))
    assert VIEW.reach(theta) == pytest.approx(farthest, rel=1e-6)


@pytest.mark.parametrize("k", [-0.1, 1.1])
def test_an_impossible_share_of_room_is_refused(k):
    with pytest.raises(ValueError, match=f"{k}"):
        least_room(VIEW, 0, k)


@pytest.mark.parametrize(
    ("least", "free", "weight"),
    [(50, 50, 1.0), (50, 100, 1.5), (50, 25, 0.5), (50, 0, 0.0), (50, -10, 0.0), (0, 9, 2.0)],
)
def test_weight_by_the_room(least, free, weight):
    assert weight_on_one(least, free) == weight


@given(st.floats(0, 2 * pi), turns)
def test_with_exactly_the_least_room_travel_is_parallel_to_the_edge(theta, turn):
    rho = VIEW.reach(theta) * 0.75
    assert same_direction(heading_on_one(VIEW, theta, rho, 0.25, turn), theta + turn * pi / 2, 1e-6)


@given(st.floats(0, 2 * pi), st.floats(0.01, 0.7), turns)
def test_with_plenty_of_room_travel_leans_inward_with_little_outward(theta, share, turn):
    plenty = heading_on_one(VIEW, theta, VIEW.reach(theta) * share, 0.25, turn)
    little = heading_on_one(VIEW, theta, VIEW.reach(theta) * (0.8 + share / 4), 0.25, turn)
    assert cos(plenty - theta) < 0 < cos(little - theta)
    assert turn * sin(plenty - theta) >= 0 <= turn * sin(little - theta)


@given(angle, st.floats(0, 300), angle, turns)
def test_heading_on_one_edge_turns_with_the_image(theta, rho, turned, turn):
    a = heading_on_one(ROUND, theta, rho, 0.25, turn)
    assert same_direction(heading_on_one(ROUND, theta + turned, rho, 0.25, turn), a + turned)
    b = heading_on_wrong_side(ROUND, theta, rho, 0.25, turn)
    assert same_direction(heading_on_wrong_side(ROUND, theta + turned, rho, 0.25, turn), b + turned)


@given(angle, turns, st.floats(0, 1))
def test_heading_does_not_jump_where_the_centre_crosses_the_edge(theta, turn, k):
    on_blade = heading_on_one(VIEW, theta, 0.0, k, turn)
    beyond = heading_on_wrong_side(VIEW, theta + pi, 0.0, k, turn)
    assert same_direction(on_blade, beyond)


@given(angle, st.floats(0, 300), turns)
def test_from_beyond_the_edge_travel_returns_to_the_blade_and_onward(theta, rho, turn):
    heading = heading_on_wrong_side(VIEW, theta, rho, 0.25, turn)
    assert cos(heading - theta) > 0
    along = theta + pi + turn * pi / 2
    assert cos(heading - along) >= -1e-9


@given(angle, st.floats(0.05, pi - 0.05))
def test_the_side_of_the_normal_on_which_the_blade_runs(theta, off):
    assert turn_of(theta, theta + off) == 1
    assert turn_of(theta, theta - off) == -1


@given(st.floats(0, 2 * pi), st.floats(0, 200), st.floats(1, 8))
def test_a_step_to_an_edge_brings_the_centre_onto_it(theta, rho, depth):
    """The pinhole itself says where a point of the edge lies after the step."""
    camera = Camera(612, 512, 616, 616, 305.5, 255.5)
    point = np.array([depth, depth / 616 * rho * cos(theta), depth / 616 * rho * sin(theta)])
    moved = point - step_to_edge(VIEW, theta, rho, depth, 3.0)
    assert moved[0] == pytest.approx(3.0)
    assert camera.project(moved)[0] == pytest.approx(camera.centre, abs=1e-6)


@given(angle, st.floats(0, 2), st.floats(2, 6))
def test_a_step_along_has_its_length_and_corrects_the_standoff(omega, length, depth):
    step = step_along(omega, length, depth, 3.0)
    assert step[0] == pytest.approx(depth - 3.0)
    assert hypot(*step[1:]) == pytest.approx(length)
    assert np.allclose(step[1:], length * np.array([cos(omega), sin(omega)]))


@given(st.floats(0, 2 * pi), st.floats(0, 250), st.floats(2, 6))
def test_repositioning_leaves_the_old_edge_its_least_room(theta, rho, depth):
    """5.24, 5.25: after the step the edge left behind has ρ_min to the border, or had less and nothing moved."""
    free, least = free_room(VIEW, theta, rho), least_room(VIEW, theta, 0.25)
    room = reposition_room(free, least)
    step = step_to_other_side(VIEW, theta + pi, room, depth, depth)
    moved = -(step[1] * cos(theta) + step[2] * sin(theta)) * VIEW.focal_px / depth
    left = free_room(VIEW, theta, rho + moved)
    assert left == pytest.approx(min(free, least), abs=1e-6)


@given(st.floats(0, 2 * pi), st.floats(0, 250), st.floats(2, 6))
def test_after_repositioning_the_camera_turns_back_to_where_it_looked(theta, room, depth):
    """5.26: the fixation point after the step is the surface point that was at the centre before it."""
    step = step_to_other_side(VIEW, theta + pi, room, depth, depth)
    old_centre = np.array([depth, 0, 0]) - step
    pixel = VIEW.focal_px * old_centre[1:] / old_centre[0]
    assert np.allclose(fixation_point(theta, room), pixel)


def test_camera_to_body_to_north_east_down():
    """A camera turned right by 90° and a vehicle that faces east see south ahead."""
    ahead = camera_to_body(np.array([2.0, 0, 0]), pi / 2, 0.0)
    assert np.allclose(ahead, [0, 2, 0])
    assert np.allclose(body_to_ned(ahead, np.array([0, 0, pi / 2])), [-2, 0, 0])
    assert np.allclose(camera_to_body(np.array([1.0, 0, 0]), 0.0, pi / 2), [0, 0, -1])


@given(st.floats(-pi, pi), st.floats(-1.5, 1.5))
def test_gimbal_angles_and_optical_axis_are_inverse(yaw, pitch):
    back = angles_of(7.0 * axis_of(yaw, pitch))
    assert same_direction(back[0], yaw, 1e-6)
    assert back[1] == pytest.approx(pitch, abs=1e-6)


@given(st.floats(-250, 250), st.floats(-250, 250))
def test_the_gimbal_reference_centres_an_image_point(y, z):
    """5.12 against its own tangents, and against where the turned axis points for small pitch."""
    yaw, pitch = turn_toward(np.array([y, z]), 616)
    assert tan(yaw) == pytest.approx(y / 616)
    assert tan(pitch) == pytest.approx(-z / 616)
    if abs(z) < 1e-6:
        assert np.allclose(axis_of(yaw, 0.0), np.array([1, y / 616, 0]) / hypot(1, y / 616), atol=1e-6)


def test_pd_commands_the_reference_and_leads_a_moving_one():
    still, error = pd_angles((0.2, -0.1), (0.1, 0.0), None, 0.05)
    assert still == pytest.approx((0.2, -0.1))
    leading, _ = pd_angles((0.3, -0.1), (0.1, 0.0), error, 0.1, p=1.0, d=0.5)
    assert leading == pytest.approx((0.3 + 0.5 * 1.0, -0.1))


def test_pd_takes_the_short_way_round():
    command, _ = pd_angles((-3.1, 0.0), (3.1, 0.0), None, 0.05, p=0.5)
    assert same_direction(command[0], pi)


def test_a_pid_of_a_constant_error_is_its_closed_form():
    pid, state = Pid(p=2.0, i=0.5), PidState()
    for n in range(1, 41):
        output, state = pid.step(0.3, 0.1, state)
        assert output == pytest.approx(2.0 * 0.3 + 0.5 * 0.3 * 0.1 * n)


def test_a_pid_of_a_ramp_is_its_closed_form():
    pid, state = Pid(p=0.0, d=0.7), PidState()
    outputs = []
    for n in range(5):
        output, state = pid.step(0.2 * n, 0.1, state)
        outputs.append(output)
    assert outputs == pytest.approx([0, 1.4, 1.4, 1.4, 1.4])


def test_the_integral_does_not_wind_up_at_the_limit():
    pid, state = Pid(p=1.0, i=1.0, limit=0.5), PidState()
    for _ in range(1000):
        output, state = pid.step(2.0, 0.1, state)
        assert output == 0.5
    output, state = pid.step(-0.1, 0.1, state)
    assert output < 0


def test_output_and_integral_and_rate_stay_in_their_limits():
    pid, state = Pid(p=5.0, i=2.0, limit=1.0, integral_limit=0.2, rate=0.5), PidState()
    last = None
    for error in [1, 1, 1, -3, -3, 4, 0, 0, 0.01] * 20:
        output, state = pid.step(error, 0.1, state)
        assert abs(output) <= 1.0 and abs(state.integral) <= 0.2 + 1e-12
        assert last is None or abs(output - last) <= 0.05 + 1e-12
        last = output


def test_a_step_of_no_time_changes_nothing_but_the_proportional_part():
    output, state = Pid(p=1.0, i=1.0, d=1.0, rate=inf).step(0.5, 0.0, PidState(0.1, 0.2, 0.3))
    assert output == pytest.approx(0.6)
    assert state.integral == 0.1
    assert atan(output) > 0
