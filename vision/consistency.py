"""Whether innovations are as large as the tracker claims: the χ² test of their sum, correlation allowed for."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

Array = NDArray[np.float64]
LAGS = 25  # samples beyond which innovations are taken to have nothing to do with one another


@dataclass(frozen=True)
class Consistency:
    """ratio: normalised innovations squared over their degrees of freedom, 1 where claims are right. low, high: between
    which it lies in 95 % of cases if they are. samples: how many innovations."""

    ratio: float
    low: float
    high: float
    samples: int


def consistency(nis: Sequence[float], dof: Sequence[int]) -> Consistency | None:
    """Of a row of innovations in order of time; None without any. The interval is that of χ² with as many degrees of
    freedom as independent samples would have: neighbours that resemble each other count for less."""
    used = [(n, d) for n, d in zip(nis, dof, strict=True) if d > 0 and np.isfinite(n)]
    if not used:
        return None
    values, freedom = np.array(used, float).T
    total = float(freedom.sum())
    free = max(total / correlation(values / freedom), 1.0)
    low, high = (float(chi2.ppf(share, free)) / free for share in (0.025, 0.975))
    return Consistency(float(values.sum()) / total, low, high, len(values))


def correlation(series: Array) -> float:
    """By how many times fewer independent samples would know as much of the mean: 1 + 2 Σ autocorrelation (Bartlett's
    weights), at least 1."""
    values = series - series.mean()
    variance = float(np.mean(values**2))
    if variance == 0 or len(values) < 3:
        return 1.0
    lags = range(1, min(LAGS, len(values) // 2) + 1)
    alike = [(1 - k / (len(values) // 2 + 1)) * float(np.mean(values[:-k] * values[k:])) / variance for k in lags]
    return max(1.0, 1.0 + 2.0 * sum(alike))


class Watch:
    """Says when innovations have been larger than claimed for a while. `add` each in order of time."""

    def __init__(self, samples: int = 20, share: float = 0.9999, correlated: float = 3.0) -> None:
        """samples: how many must agree in being too large. share: of right trackers that stay under the bound;
        correlated: by how many times fewer of the samples are independent."""
        self._recent: deque[tuple[float, int]] = deque(maxlen=samples)
        self._share, self._correlated = share, correlated
        self.excess: float | None = None

    def add(self, nis: float, dof: int) -> bool:
        """Whether the answer has just changed; `excess` is by how much innovations are too large now, None where they
        are not."""
        if dof > 0 and np.isfinite(nis):
            self._recent.append((nis, dof))
        total, free = (float(sum(column)) for column in zip(*self._recent, strict=True)) if self._recent else (0.0, 0.0)
        before = self.excess
        self.excess = None
        if len(self._recent) == self._recent.maxlen:
            independent = free / self._correlated
            if total / free > chi2.ppf(self._share, independent) / independent:
                self.excess = total / free
        return (before is None) != (self.excess is None)

    def forget(self) -> None:
        """Begin anew, as after the tracker forgot."""
        self._recent.clear()
        self.excess = None
