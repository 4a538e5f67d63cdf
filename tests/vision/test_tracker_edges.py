"""Edges that bend, jump or run away: the tracker keeps to what is seen, and to what blades are like."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.vision.test_tracker import CAMERA, SETTINGS, Blade, Flight, blade_frame, observed, settled
from vision.blade_motion import EDGE, EDGE_CURVATURE
from vision.capture import CameraPose
from vision.observation import BladeObservation, Edge, Line
from vision.tracker import BladeTracker, Kept

PERIOD = 0.2
HALF_SEEN_M = 1.2  # of an edge, along the span, at 3 m
SIGMA_THETA, SIGMA_RHO = 0.0005, 0.15


def flared(seed: int, flares_m: float, shoulder_m: float) -> Blade:
    """A blade whose trailing edge flares out from a station behind its round root, up to a shoulder, and tapers from
    there."""
    blade = Blade(blade_frame(0.4, 0.1), seed, wander=0.0)
    stations = [0.0, flares_m, flares_m + 0.7, shoulder_m - 0.9, shoulder_m, 12.0, 45.0]
    slopes = [0.0, 0.0, -0.4, -0.35, 0.1, 0.1, 0.06]
    blade.slopes["trailing"] = np.interp(blade.stations, stations, slopes)
    blade.values["trailing"] = -0.95 + np.cumsum(blade.slopes["trailing"]) * blade.step
    return blade


def line_through(blade: Blade, side: str, true: CameraPose, rng: np.random.Generator) -> Edge:
    """What an eye makes of a bent edge: the straight line through all of it that it sees."""
    station, _, _ = blade.frame.to_blade(true.position)
    along = station + np.linspace(-HALF_SEEN_M, HALF_SEEN_M, 49)
    offsets = np.interp(along, blade.stations, blade.values[side])
    depths = [blade.state(s, n)[0] for s, n in zip(along, offsets, strict=True)]
    points = (
        CAMERA.project(true.from_ned(blade.frame.to_ned(np.column_stack([along, offsets, depths])))) - CAMERA.centre
    )
    middle = points.mean(axis=0)
    run = np.linalg.svd(points - middle)[2][0]
    inside = CAMERA.project(
        true.from_ned(blade.frame.to_ned(np.array([[station, -0.5, blade.state(station, -0.5)[0]]])))
    )
    normal = np.array([-run[1], run[0]])
    outward = normal * np.sign(normal @ (middle + CAMERA.centre - inside[0]))
    theta = np.arctan2(outward[1], outward[0]) + rng.normal(0, SIGMA_THETA)
    outward = np.array([np.cos(theta), np.sin(theta)])
    rho = float(outward @ middle) + rng.normal(0, SIGMA_RHO)
    line = Line(theta, rho) if rho >= 0 else Line(theta + np.pi, -rho)
    return Edge(line, outward, SIGMA_THETA, SIGMA_RHO, 1.0, points[[0, -1]])


def seen(blade: Blade, stamp_s: float, true: CameraPose, rng: np.random.Generator) -> BladeObservation:
    """Surface and both edges of a bent blade."""
    rough = observed(blade, stamp_s, true, rng, ("leading", "trailing"))
    return replace(rough, edges=tuple(line_through(blade, side, true, rng) for side in ("leading", "trailing")))


@pytest.mark.parametrize("flares_m", [3.0, 3.8])
@pytest.mark.parametrize("shoulder_m", [8.3, 10.0])
@pytest.mark.parametrize("outward_bound", [True, False])
def test_an_edge_that_flares_as_a_shoulder_does_is_never_lost_for_a_second(
    flares_m: float, shoulder_m: float, outward_bound: bool
) -> None:
    rng = np.random.default_rng(7)
    blade = flared(7, flares_m, shoulder_m)
    flight = Flight(blade, rng, np.zeros(3), jitter_m=0.005, attitude=0.0005)
    tracker = BladeTracker(blade.frame, CAMERA)
    way = np.arange(3.8, 14.0, 0.8 * PERIOD)
    stations = way if outward_bound else way[::-1]
    for k, station in enumerate(np.concatenate([np.full(10, stations[0]), stations])):
        now = k * PERIOD
        true = flight.true_pose(station, -0.8, standoff=3.5)
        pose = flight.reported(true)
        tracker.update(seen(blade, now, true, rng), pose)
        estimate = tracker.estimate(now, pose)
        if now > 1.0:
            for edge, value in ((estimate.leading, 3), (estimate.trailing, 5)):
                assert edge is not None and edge.age_s < 1.0
                assert edge.offset_m == pytest.approx(blade.state(estimate.station_m, 0.0)[value], abs=0.15)


def test_an_edge_that_agrees_with_itself_elsewhere_is_taken_up_there_while_the_view_moves_on() -> None:
    flight, tracker, _ = settled()
    rng = np.random.default_rng(3)
    blade = flight.blade
    before = tracker.estimate(2.0, flight.true_pose(15.0, -0.4)).trailing.offset_m
    blade.values["trailing"] = blade.values["trailing"] - 0.5
    taken = []
    for k in range(8):
        true = flight.true_pose(15.0 + 0.1 * k, -0.4)
        result = tracker.update(seen(blade, 2.0 + k * PERIOD, true, rng), flight.reported(true))
        assert result.accepted
        taken.append("trailing" in result.parts)
    assert not any(taken[:5])
    assert taken[-1]
    assert tracker.estimate(3.4, true).trailing.offset_m == pytest.approx(before - 0.5, abs=0.1)


def test_edges_that_agree_neither_with_what_is_tracked_nor_with_one_another_are_not_taken_up() -> None:
    flight, tracker, true = settled()
    rng = np.random.default_rng(8)
    before = tracker.estimate(2.0, true).trailing.offset_m
    for k in range(24):
        observation = flight.observation(2.0 + k * PERIOD, true)
        edge = observation.edges[1]
        turned = edge.line.theta + rng.choice([-1, 1]) * rng.uniform(0.1, 0.4)
        outward = np.array([np.cos(turned), np.sin(turned)])
        result = tracker.update(
            replace(
                observation,
                edges=(replace(edge, line=Line(turned, edge.line.rho + rng.uniform(40, 200)), outward=outward),),
            ),
            true,
        )
        assert result.accepted and "trailing" not in result.parts
    assert tracker.estimate(6.8, true).trailing.offset_m == pytest.approx(before, abs=0.1)


@pytest.mark.parametrize(("slope", "offset"), [(-0.5, -1.6), (0.5, -1.6), (0.0, -9.0), (0.0, 3.0)])
def test_an_edge_that_no_blade_has_is_forgotten_at_once(slope: float, offset: float) -> None:
    flight, tracker, true = settled()
    kept = tracker.kept()
    mean = kept.model.mean.copy()
    mean[EDGE["trailing"]], mean[EDGE_CURVATURE["trailing"]] = (offset, slope), 0.0
    covariance = kept.model.covariance.copy()
    covariance[EDGE["trailing"], EDGE["trailing"]] *= 4.0
    tracker.go_on_from(Kept(replace(kept.model, mean=mean, covariance=covariance), kept.stamp_s, kept.seen_s))
    assert tracker.estimate(2.0, true).trailing is None
    assert tracker.estimate(2.0, true).leading is not None
    tracker.update(flight.observation(2.0, true, ("leading",)), true)
    result = tracker.update(flight.observation(2.1, true), true)
    assert "trailing" in result.parts
    assert tracker.estimate(2.1, true).trailing.offset_m == pytest.approx(flight.blade.state(15.0, 0.0)[5], abs=0.1)
    assert SETTINGS.steepest_edge[1] < abs(slope) or not 0 < 1.0 - offset <= SETTINGS.largest_chord_m
