"""Whether a step that no dots tell of is imaged as the blade's edges are. Where dots ought to lie beyond an edge and do
not, the blade ends; where none could, its own seams and shadows, cables and the background make steps too. But both
sides of an edge differ for good, unlike those of a seam or a cable, and it is as sharp as the camera draws it, unlike
the rim of a shadow: it rises as quickly to its full height as the edges that dots do tell of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate
from vision.capture import Image
from vision.lines import sampled
from vision.surface_kernels import median

Array = NDArray[Any]  # of floats

NEAR = 1.0  # px to each side, between which a step has risen in part
FAR = (4.0, 6.0, 8.0)  # px to each side, between which it has risen in full
PLACES = 6  # along an edge, of which at least so many have to be inside the image
PASSES = 4  # of the robust fit
APART, SIGMAS = 0.12, 2.0  # by how much the rises of two edges of a blade may differ, besides their standard deviations
CLEARER = 2.0  # times the step of another edge, from which that one tells nothing: its own surroundings blur it
DRAWN = (0.35, 1.1)  # the rise of an edge as cameras draw it, where no other edge tells
UNSURE_SHADE = 0.5  # of what a blade's shade goes on to change from the nearest of FAR to the edge itself
MOST_EMPTY = 0.15  # of the dots up to a step that may be missing, or the blade ends before it


@dataclass(frozen=True)
class Rise:
    """What share of a step's full height it rises within two pixels: 1 where it is perfectly sharp, less where it is
    soft, more where both sides are alike farther off; its standard deviation; and how many of FAR tell it."""

    share: float
    sigma: float
    reach: int


def rise_of(edge: Candidate, tones: Image, most: int = len(FAR)) -> Rise | None:
    """How the step of an edge rises in tones (h, w, c), as far from it as the image and `most` of FAR go; None where
    too little of it is in the image."""
    profile, k = edge.profile, edge.index
    t = profile.t[k]
    use = profile.agrees[k] & (t >= edge.ends[0] - 1) & (t <= edge.ends[1] + 1)
    t = t[use]
    base = edge.rho + 0.5 * profile.bend[k] * (t - profile.focus[k]) ** 2
    foot = t[:, None] * profile.direction[k] + base[:, None] * edge.outward
    half = (np.array(tones.shape[1::-1]) - 1) / 2
    for reach in range(most, 0, -1):
        inside = (np.abs(foot) + FAR[reach - 1] * np.abs(edge.outward) < half).all(axis=1)
        if inside.sum() >= PLACES:
            return _fitted(foot[inside] + half, edge.outward, tones, reach)
    return None


def _fitted(places: Array, outward: Array, tones: Image, reach: int) -> Rise:
    sides = np.array([*FAR[:reach], NEAR])
    points = places + (np.r_[sides, -sides][:, None] * outward)[:, None]
    values = sampled(tones, points[..., 0], points[..., 1]).astype(float)
    inner, shade = values[len(sides) :], np.zeros(values.shape[-1])
    if reach > 1:  # a blade that rounds away from the light darkens toward its edge, all along it
        shade = np.median(inner[0] - inner[reach - 1], axis=0) / (FAR[reach - 1] - FAR[0])
    change = values[: len(sides)] - inner - sides[:, None, None] * shade
    full, part = change[:reach].mean(axis=0), change[reach]
    channel = np.abs(full).argmax(axis=1)[:, None]
    full, part = (np.take_along_axis(tone, channel, 1)[:, 0] for tone in (full, part))
    weight = np.ones(len(full))
    for _ in range(PASSES):
        squares = float((weight * full**2).sum()) + 1e-6
        share = float((weight * full * part).sum()) / squares
        residual = part - share * full
        scatter = 1.4826 * median(np.abs(residual)) + 1e-6
        weight = 1 / (1 + (residual / (2 * scatter)) ** 2) ** 2
    variance = float((weight * residual**2).sum() / weight.sum())
    rounding = UNSURE_SHADE * FAR[0] * float((weight * shade[channel[:, 0]] ** 2).sum() / squares) ** 0.5 * share
    return Rise(share, float(np.hypot(np.sqrt(4 * variance / squares), rounding)), reach)


def typical_edge(candidates: list[Candidate]) -> Candidate | None:
    """The step that is the likeliest edge of the blade by the dots missing beyond it; None without one."""
    told = [c for c in candidates if c.beyond > 0 and np.isfinite(c.value)]
    return max(told, key=lambda c: c.value, default=None)


def like_an_edge(edge: Candidate, tones: Image, typical: Candidate | None) -> bool:
    """Whether a step rises as the typical edge of the blade does, and no dots are missing before it."""
    rise = None if edge.empty > MOST_EMPTY else rise_of(edge, tones)
    if rise is None:
        return False
    if typical is not None and edge.step > CLEARER * typical.step:
        typical = None
    usual = None if typical is None else rise_of(typical, tones, rise.reach)
    if usual is None or usual.reach != rise.reach:
        return DRAWN[0] - SIGMAS * rise.sigma < rise.share < DRAWN[1] + SIGMAS * rise.sigma
    sigma = float(np.hypot(rise.sigma / rise.share, usual.sigma / usual.share))
    return abs(float(np.log(max(rise.share, 1e-6) / usual.share))) < APART + SIGMAS * sigma
