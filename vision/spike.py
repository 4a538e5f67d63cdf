"""A spiked tip: two steps that meet in a point beyond the dots; they close the blade and are not its edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate

Array = NDArray[Any]  # of floats

NARROWEST, WIDEST = np.deg2rad(20), np.deg2rad(84)  # angle of the spike
LEAST_VALUE = 2.0  # of each side as an edge
AT_APEX = 35.0  # px from the apex to where both steps end
OFF_AXIS = np.deg2rad(14)  # from the spike's middle to an edge of the blade


@dataclass(frozen=True)
class Spike:
    """Unit vector toward the apex (2,) along the blade's axis, the apex (2,), image frame, working px, and its two
    sides."""

    toward: Array
    apex: Array
    sides: tuple[Candidate, Candidate]


def find_spike(candidates: list[Candidate], dots: Array) -> Spike | None:
    """The most worthy two candidates that meet in a point just beyond all dots, None where there are none."""
    candidates = [c for c in candidates if c.value >= LEAST_VALUE]
    best: Spike | None = None
    worth = -np.inf
    for a, one in enumerate(candidates):
        for two in candidates[a + 1 :]:
            opening = np.pi - np.arccos(np.clip(float(one.outward @ two.outward), -1, 1))
            if not NARROWEST < opening < WIDEST or one.value + two.value < worth:
                continue
            apex = np.linalg.solve(np.stack([one.outward, two.outward]), np.array([one.rho, two.rho]))
            toward = one.outward + two.outward
            toward = toward / np.linalg.norm(toward)
            ahead = (dots - apex) @ toward
            if ahead.max() > -2.0 or ahead.max() < -90.0:
                continue
            middle = np.median(dots, axis=0) - apex
            if -float(middle @ toward) < np.cos(OFF_AXIS) * float(np.hypot(*middle)):
                continue
            if all(_ends_at(side, apex, toward) for side in (one, two)):
                best, worth = Spike(toward, apex, (one, two)), one.value + two.value
    return best


def _ends_at(side: Candidate, apex: Array, toward: Array) -> bool:
    """Whether a step runs up to the apex and not past it."""
    direction = side.profile.direction[side.index]
    place = float(apex @ direction)
    first, last = side.ends
    if direction @ toward > 0:
        return abs(last - place) < AT_APEX and place - first > AT_APEX
    return abs(first - place) < AT_APEX and last - place > AT_APEX


def edges_behind(candidates: list[Candidate], spike: Spike, least: float) -> tuple[Candidate, ...]:
    """The blade's own edges, nearly along the spike's axis, the best on each side of it; none, one or two."""
    found: list[Candidate] = []
    across = np.array([-spike.toward[1], spike.toward[0]])
    for side in (1.0, -1.0):
        fitting = [
            c
            for c in candidates
            if float(c.outward @ across) * side > np.cos(OFF_AXIS) and c.value >= least and c not in spike.sides
        ]
        if fitting:
            found.append(max(fitting, key=lambda c: c.value))
    return tuple(found)
