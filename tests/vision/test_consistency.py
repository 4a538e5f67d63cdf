"""The judge of the tracker's claims, against noise whose statistics are known."""

from __future__ import annotations

import numpy as np
import pytest

from vision.consistency import Watch, consistency


def innovations(rng: np.random.Generator, count: int, scale: float = 1.0, keep: float = 0.0) -> list[float]:
    """NIS of five degrees of freedom, of noise that is `scale` times as large as claimed and resembles the last."""
    noise = rng.normal(0, 1, (count, 5))
    for k in range(1, count):
        noise[k] = keep * noise[k - 1] + np.sqrt(1 - keep**2) * noise[k]
    return list((scale * noise**2).sum(axis=1))


@pytest.mark.parametrize("keep", [0.0, 0.8])
def test_right_claims_lie_within_the_interval_as_often_as_it_says(keep: float) -> None:
    rng = np.random.default_rng(1)
    within = []
    for _ in range(200):
        found = consistency(innovations(rng, 400, keep=keep), [5] * 400)
        within.append(found.low < found.ratio < found.high)
    assert 0.88 < np.mean(within) <= 1.0


@pytest.mark.parametrize("scale", [0.6, 1.6])
def test_wrong_claims_do_not(scale: float) -> None:
    found = consistency(innovations(np.random.default_rng(2), 400, scale), [5] * 400)
    assert found.ratio == pytest.approx(scale, rel=0.15)
    assert not found.low < found.ratio < found.high


def test_innovations_that_resemble_each_other_count_for_less() -> None:
    rng = np.random.default_rng(3)
    apart, alike = (consistency(innovations(rng, 400, keep=keep), [5] * 400) for keep in (0.0, 0.9))
    assert alike.high - alike.low > 2 * (apart.high - apart.low)
    assert consistency([], []) is None


def test_a_watch_speaks_up_once_when_innovations_stay_too_large_and_once_when_they_do_not_any_more() -> None:
    rng, watch, changes = np.random.default_rng(4), Watch(), []
    for k, nis in enumerate([*innovations(rng, 300), *innovations(rng, 60, 6.0), *innovations(rng, 100)]):
        if watch.add(nis, 5):
            changes.append((k, watch.excess is not None))
    assert [bad for _, bad in changes] == [True, False]
    assert 300 < changes[0][0] < 330
    assert 360 < changes[1][0] < 400
