"""Finds the blade's edges: lines with every dot of the blade on one side, unbroken beside those dots, at the blade's depth.

A line of the background (horizon, tower, another blade, a cable) ends where the blade hides it, lies behind a stronger
step, has another parallax than the blade, or leaves room on the blade where dots ought to be; a seam or a streak on the
blade has dots on both sides or a weaker step than the edge. The edges of one blade are nearly parallel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Blade, Candidate, OtherEye, weigh
from vision.capture import Image
from vision.lines import edge_pixels, hough_lines, sensor_noise, smoothed
from vision.observation import Edge, Line

Array = NDArray[np.float64]

LARGEST_TAPER = np.deg2rad(16)
LEAST_VALUE = 1.2
SECOND_EDGE = 2.2  # how much less than the better edge the other one may be worth


def find_edges(
    tones: Image, blade: Blade, other: OtherEye | None
) -> tuple[tuple[Candidate, ...], float, tuple[str, ...]]:
    """The blade's edges (none, one or two), the direction of its axis modulo π, and reasons where none is found.

    tones (h, w, c): working image, free of dots. The axis is NaN where no edge gives it.
    """
    height, width = tones.shape[:2]
    noise = sensor_noise(tones)
    lines, _ = hough_lines(edge_pixels(tones, noise), 220, (width, height))
    candidates = weigh(lines, blade, smoothed(tones), noise, other)
    chosen = _choose(candidates)
    if not chosen:
        best = max((c.support for c in candidates), default=0.0)
        return (), float("nan"), (f"no edge: the best line beside the dots has {best:.0%} support",)
    directions = np.array([np.arctan2(c.outward[1], c.outward[0]) + np.pi / 2 for c in chosen])
    axis = 0.5 * np.angle(np.exp(2j * directions).sum()) % np.pi
    return chosen, float(axis), ()


def _choose(candidates: list[Candidate]) -> tuple[Candidate, ...]:
    """The pair of nearly parallel candidates that encloses the dots best, or the best one, or none."""
    good = [c for c in candidates if c.value >= LEAST_VALUE]
    if not good:
        return ()
    good.sort(key=lambda c: -c.value)
    best_pair: tuple[float, tuple[Candidate, ...]] | None = None
    for a in range(len(good)):
        for b in range(a + 1, len(good)):
            if float(-good[a].outward @ good[b].outward) < np.cos(LARGEST_TAPER):
                continue
            total = good[a].value + good[b].value
            if best_pair is None or total > best_pair[0]:
                best_pair = (total, (good[a], good[b]))
    if best_pair is not None and min(c.value for c in best_pair[1]) > good[0].value - SECOND_EDGE:
        return best_pair[1]
    return (good[0],)


def edge_of(candidate: Candidate, factor: float) -> Edge:
    """The candidate as an edge in pixels of the full image."""
    normal = candidate.outward if candidate.rho >= 0 else -candidate.outward
    profile, k = candidate.profile, candidate.index
    ends = np.array(candidate.ends)
    direction = profile.direction[k]
    return Edge(
        Line(float(np.arctan2(normal[1], normal[0])), abs(candidate.rho * factor)),
        candidate.outward.copy(),
        float(np.hypot(profile.slope_sigma[k], 0.0005)),
        float(profile.rho_sigma[k] * factor),
        candidate.support,
        (candidate.outward * candidate.rho + ends[:, None] * direction) * factor,
    )
