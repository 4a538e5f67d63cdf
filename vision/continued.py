"""Whether the blade goes on beyond a step: then it is a streak, a seam or a shadow on it and none of its edges. The two
eyes tell, where no dots lie: what is painted on the blade looks alike at the blade's depth and at no other, what is
behind it does not."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate
from vision.capture import Image
from vision.evidence import OtherEye
from vision.lines import sampled

Array = NDArray[Any]  # of floats

PLACES = 24  # along a step
BEYOND_PX = np.arange(6.0, 31.0, 4.0)  # of it, where the eyes are compared
OFF_PX = np.array([-3.0, 0.0, 3.0])  # along the other eye's line of sight, for what the surface is off there
NEARER_PX = -14.0  # likewise, to a depth at which nothing is: where all is alike there as well, it tells nothing
LEAST_APART_PX = 14.0  # between the blade and what is far behind, in the other eye
LEAST_POINTS = 60
ALIKE = 0.7  # of how unlike the eyes are elsewhere
PAINTED = 2.0  # times what the eyes differ by, that the stretch itself has to vary by


def continues(edge: Candidate, smooth: Image, other: OtherEye, noise: float) -> bool:
    """Whether both eyes see the blade's own surface just beyond a step. smooth (h, w, c): the left eye's working image,
    smoothed; noise: of its pixels, in grey levels. False where nothing is painted on it that could tell."""
    profile, k = edge.profile, edge.index
    t = np.linspace(edge.ends[0], edge.ends[1], PLACES)
    base = edge.rho + 0.5 * profile.bend[k] * (t - profile.focus[k]) ** 2
    foot = t[:, None] * profile.direction[k] + base[:, None] * edge.outward
    points = (foot[:, None] + BEYOND_PX[:, None] * edge.outward).reshape(-1, 2)
    half = (np.array(smooth.shape[1::-1]) - 1) / 2
    points = points[(np.abs(points) < half - 2).all(axis=1)]
    if len(points) < LEAST_POINTS:
        return False
    there, _, far = other.shows(points)
    apart = float(np.mean(np.hypot(*(far - there).T)))
    if apart < LEAST_APART_PX:
        return False
    way = (far - there).mean(axis=0) / apart
    places = (np.stack([there, there + NEARER_PX * way, far])[:, None] + OFF_PX[:, None, None] * way).reshape(
        -1, *there.shape
    )
    size = np.array(other.smooth.shape[1::-1])
    inside = ((places > 1) & (places < size - 2)).all(axis=(0, 2))
    if np.count_nonzero(inside) < LEAST_POINTS:
        return False
    points, places = points[inside] + half, places[:, inside]
    seen = sampled(smooth, points[:, 0], points[:, 1])
    unlike = _spread(seen - sampled(other.smooth, places[..., 0], places[..., 1]))
    (before, blade, after), *elsewhere = unlike.reshape(3, -1)
    if not blade <= min(before, after):
        return False  # it lies nearer or farther off
    nearer, behind = (float(each.min()) for each in elsewhere)
    varied = float(_spread(seen[None])[0])
    return bool(blade < min(ALIKE * min(nearer, behind), noise, varied / PAINTED))


def _spread(tones: Array) -> Array:
    """How much tones (m, n, c) vary on the mean, (m,): each of the tone that varies most there."""
    return np.asarray(np.abs(tones - np.median(tones, axis=1, keepdims=True)).max(axis=2).mean(axis=1))
