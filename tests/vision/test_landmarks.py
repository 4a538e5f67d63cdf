"""Tip and root: single sightings add up to a fact, and noise does not."""

from __future__ import annotations

import numpy as np
import pytest

from vision.landmarks import RootWatch, TipSighting, agreed_tip


def sightings(*stations: float) -> list[TipSighting]:
    return [TipSighting(10.0 + i * 0.2, station) for i, station in enumerate(stations)]


def test_three_sightings_that_agree_are_a_tip() -> None:
    assert agreed_tip(sightings(39.9, 40.1, 40.0), since_s=0.0) == pytest.approx(40.0)


def test_two_sightings_are_not_enough() -> None:
    assert agreed_tip(sightings(39.9, 40.1), since_s=0.0) is None


def test_old_sightings_do_not_count() -> None:
    assert agreed_tip(sightings(39.9, 40.1, 40.0), since_s=10.3) is None


def test_sightings_all_over_the_blade_are_no_tip() -> None:
    assert agreed_tip(sightings(20.0, 25.0, 31.0, 36.0, 40.0), since_s=0.0) is None


def chord_of_v80(station: np.ndarray) -> np.ndarray:
    """Like a V80: 0.5 m at the tip, 3.5 m at 9 m from the hub, a 1.9 m cylinder at the root."""
    return np.interp(station, [1.0, 3.0, 9.0, 40.0], [1.9, 1.9, 3.5, 0.5])


def test_the_root_is_where_the_chord_has_fallen_near_the_hub() -> None:
    watch = RootWatch(radius_m=5.0)
    found = None
    for station in np.arange(39.0, 1.5, -0.2):
        found = watch.update(float(station), float(chord_of_v80(station)))
        if found is not None:
            break
    assert found is not None and 2.5 < found < 5.0


def test_a_narrow_tip_is_no_root() -> None:
    watch = RootWatch(radius_m=5.0)
    assert all(watch.update(float(s), float(chord_of_v80(s))) is None for s in np.arange(40.0, 6.0, -0.2))


def test_without_chords_there_is_no_root() -> None:
    watch = RootWatch(radius_m=5.0)
    assert all(watch.update(float(s), None) is None for s in np.arange(40.0, 1.0, -0.2))
