"""Whether a step that no dots lie beside is an edge: the blade's own shade, seams and dirt make steps there too, and
neither the dots nor the other eye can tell them from an edge. What is beyond an edge does not look like the blade."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate
from vision.capture import Image
from vision.evidence import BEYOND_PX, Blade
from vision.lines import sampled

Array = NDArray[Any]  # of floats

ACROSS = (5.0, 8.0, 12.0, 16.0)  # px beyond a step where its outside is looked at
ALONG = 40  # places along it
SPACING = (16.0, 44.0)  # px between neighbouring dots, midway between which the blade itself is seen
ORDINARY = 0.05  # share of the blade that is brighter, and darker, than what it ordinarily shows
LEAST_UNLIKE, TEXTURES = 0.5, 4.0  # of the step, and of the blade's own: so far out of its range the outside lies
MOST_EMPTY = 0.15  # of the dots up to a step that may be missing, or the blade ends before it
LEAST_TINT, SPREADS = 0.01, 3.0  # of another colour: log of the ratio of tones, and in spreads of the blade's own
DARK = 4.0  # grey levels added before ratios are taken
FEWEST = 5  # places that tell what the blade looks like


def witnessed(edge: Candidate, dots: Array, reach: float = BEYOND_PX) -> bool:
    """Whether dots lie beside the step, or are missing beyond it, near enough to tell that the blade ends there."""
    if edge.beyond > 0:
        return True
    along = dots @ edge.profile.direction[edge.index]
    beside = (along > edge.ends[0] - reach) & (along < edge.ends[1] + reach)
    return bool((edge.rho - dots[beside] @ edge.outward < reach).any())


def parts_unlike(edge: Candidate, blade: Blade, smooth: Image) -> bool:
    """Whether what is beyond a step has another colour than the blade between its dots, or is brighter or darker than
    the blade ordinarily is by far, and no dots are missing before it."""
    centre = (np.array(smooth.shape[1::-1]) - 1) / 2
    own = _tones(smooth, _between(blade.dots) + centre)
    place = np.linspace(*edge.ends, ALONG)[:, None] * edge.profile.direction[edge.index]
    outside = _tones(smooth, np.vstack([place + edge.outward * (edge.rho + off) for off in ACROSS]) + centre)
    if len(own) < FEWEST or len(outside) < FEWEST or edge.empty > MOST_EMPTY:
        return False
    low, high = np.quantile(own, [ORDINARY, 1 - ORDINARY], axis=0)
    typical = np.median(outside, axis=0)
    unlike = float(np.maximum(low - typical, typical - high).max())
    if unlike > max(LEAST_UNLIKE * edge.step, TEXTURES * blade.texture):
        return True
    tint, theirs = _tint(own), _tint(outside)
    apart = np.abs(np.median(theirs, axis=0) - np.median(tint, axis=0))
    return bool((apart > LEAST_TINT + SPREADS * tint.std(axis=0)).any())


def _between(dots: Array) -> Array:
    """Points (n, 2) midway between neighbouring dots."""
    apart = np.hypot(*(dots[:, None] - dots[None]).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu((apart > SPACING[0]) & (apart < SPACING[1]), 1))
    return np.asarray((dots[first] + dots[second]) / 2)


def _tones(smooth: Image, pixels: Array) -> Array:
    """Tones (n, c) at those of some pixels that lie in the image."""
    inside = ((pixels > 2) & (pixels < np.array(smooth.shape[1::-1]) - 3)).all(axis=1)
    pixels = pixels[inside]
    return sampled(smooth, pixels[None, :, 0], pixels[None, :, 1])[0] if len(pixels) else np.zeros((0, smooth.shape[2]))


def _tint(tones: Array) -> Array:
    """Logs (n, c) of tones over their mean: what shade leaves alone; zero without colour."""
    logs = np.log(tones + DARK)
    return np.asarray(logs - logs.mean(axis=1, keepdims=True))
