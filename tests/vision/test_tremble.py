"""The tracker learns how much of what the eye claims is new in every frame, and holds its own claims to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.vision.test_tracker import CAMERA, PERIOD, PLANE_SIGMA, SETTINGS, Blade, Flight, blade_frame
from vision.observation import BladeObservation
from vision.tracker import BladeTracker, UpdateResult


def claiming(observation: BladeObservation, times: float) -> BladeObservation:
    """The same, of an eye that claims so many times the sigmas."""
    assert observation.plane_covariance is not None and observation.distance_sigma_m is not None
    return replace(
        observation,
        plane_covariance=observation.plane_covariance * times**2,
        distance_sigma_m=observation.distance_sigma_m * times,
        edges=tuple(
            replace(e, sigma_theta=e.sigma_theta * times, sigma_rho_px=e.sigma_rho_px * times)
            for e in observation.edges
        ),
    )


def flown(times: float, seconds: float = 40.0) -> tuple[list[UpdateResult], BladeTracker, float]:
    """A flight along a blade whose eye's noise is PLANE_SIGMA while it claims `times` as much; the last distance's
    sigma."""
    frame = blade_frame(0.8)
    rng = np.random.default_rng(5)
    flight = Flight(Blade(frame, 5), rng, np.zeros(3), jitter_m=0.01, attitude=0.0008)
    tracker = BladeTracker(frame, CAMERA, SETTINGS)
    updates = []
    for k in range(int(seconds / PERIOD)):
        true = flight.true_pose(12.0 + 0.05 * k * PERIOD, -0.4 + 0.1 * np.sin(k / 20))
        pose = flight.reported(true)
        updates.append(tracker.update(claiming(flight.observation(k * PERIOD, true), times), pose))
    estimate = tracker.estimate(seconds, pose)
    assert estimate is not None
    return updates, tracker, estimate.distance_sigma_m


@pytest.mark.parametrize("times", [0.6, 1.0, 3.0])
def test_innovations_become_as_large_as_claimed_whatever_share_of_the_eyes_claims_is_new(times: float) -> None:
    updates, _, _ = flown(times)
    settled = [update for update in updates[150:] if update.accepted]
    assert len(settled) > 0.95 * len(updates[150:])
    assert 0.8 < sum(update.nis for update in settled) / sum(update.dof for update in settled) < 1.25


def test_what_the_eye_repeats_stays_in_the_distances_sigma() -> None:
    _, _, honest = flown(1.0)
    _, _, repeated = flown(3.0)
    assert honest < PLANE_SIGMA[0] < repeated < 3.2 * PLANE_SIGMA[0]


def test_a_surface_that_leans_otherwise_counts_for_its_distance_alone_until_it_has_gone_on_so() -> None:
    _, tracker, _ = flown(1.0, 20.0)
    frame = blade_frame(0.8)
    flight = Flight(Blade(frame, 5), np.random.default_rng(6), np.zeros(3), jitter_m=0.01, attitude=0.0008)
    before = flight.blade.state(13.0, -0.4)[2]
    across = []
    for k in range(10):
        stamp_s = 20.0 + k * PERIOD
        true = flight.true_pose(13.0, -0.4)
        observation = flight.observation(stamp_s, true, ())
        assert observation.normal is not None
        turned = observation.normal + 0.25 * frame.across @ true.rotation
        pose = flight.reported(true)
        result = tracker.update(replace(observation, normal=turned / np.linalg.norm(turned)), pose)
        assert result.accepted
        if k == 0:
            assert result.dof == 1 and "leans" in " ".join(result.reasons)
        estimate = tracker.estimate(stamp_s, pose)
        assert estimate is not None
        across.append(estimate.across_slope)
    assert across[0] == pytest.approx(before, abs=0.03)
    assert abs(across[-1] - before) > 0.15
