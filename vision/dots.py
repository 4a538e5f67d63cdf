"""Finds laser dots to a fraction of a pixel in a laser-on image, with or without a laser-off image of it (2.75)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.motion import motion_between
from vision.peaks import Peaks, Reach, gained, standing_out
from vision.reduction import GREEN, half_green
from vision.spot_belief import believed, typical_shape
from vision.spot_fit import fit_spots
from vision.spot_light import lights

Array = NDArray[Any]  # of floats

USUAL_SHAPE = (0.4, 0.0, 0.4)  # 1/px², before the image has shown its own
SHAPED = 16  # spots of which the shape is learnt
SHAPE_REACH = 6  # px, half the square in which the shape is learnt
BURNT_LEVEL = 90.0  # grey levels, first guess of a spot whose middle is burnt out
REACHES = (4, 8)  # px, least and largest half square in which a spot is measured
REGISTRATION_PX = 0.12  # how far laser-off and laser-on images may lie apart after their motion is made up for
LEAST_VARIANCE = 0.1  # grey levels², of rounding
SIGNIFICANT = 3.0  # standard deviations of a spot's level
LONE = 1.5  # times as uncertain is a spot's place where what lies under it is guessed from around it
LEAST_SIGMA_PX = 0.02
WORST_PX = 0.35  # a standard deviation from which a place is none
APART_PX = 4.0  # nearer to a stronger one a spot is part of it


@dataclass(frozen=True)
class Spots:
    """Bright compact spots that the laser may have made: uv (n, 2) px, level above the surroundings, sigma_px (n,).

    motion (2,) px brings the laser-off image onto the laser-on image. shape (3,): inverse covariance (uu, uv, vv) in
    1/px² of the Gaussian that the spots of this image resemble."""

    uv: Array
    level: Array
    sigma_px: Array
    motion: Array
    shape: Array

    def __len__(self) -> int:
        return len(self.uv)


def find_spots(
    off: Image | None, on: Image, reach: Reach | None = None, other: Spots | None = None, small: Image | None = None
) -> Spots:
    """Spots of a laser-on image (h, w) or (h, w, 3) uint8 of working size that its laser-off image, if there is one,
    does not have; of their green.

    reach: where the laser's dots can be at all. other: the spots of the other eye, whose motion and shape are the first
    guess here. small: `half_green` of the laser-on image, where it is known.
    """
    small = half_green(on) if small is None else small
    motion = np.zeros(2)
    if reach is None:
        reach = Reach.everywhere(small.shape)
    if off is None:
        peaks = standing_out(small, reach)
    else:
        small_off = half_green(off)
        motion = motion_between(small_off, small, None if other is None else other.motion)
        peaks = gained(small_off, small, motion, reach)
    shape = np.array(USUAL_SHAPE) if other is None else other.shape
    if len(peaks) == 0:
        return Spots(np.empty((0, 2)), np.empty(0), np.empty(0), motion, shape)
    # not the strongest alone: those may be what two images of a steep background have left
    some = peaks[: len(peaks) * 2 // 3 : max(len(peaks) * 2 // 3 // SHAPED, 1)]
    shape = _shape(on, off, np.ascontiguousarray(some if len(some) > 2 else peaks), motion, shape)
    return _measured(on, off, peaks, motion, shape)


@lru_cache(maxsize=8)
def _quadratic(reach: int) -> tuple[Array, Array]:
    """(fit (6, p), basis (6, p)) of a quadratic surface on a square of (2 reach + 1)² pixels."""
    v, u = (g.ravel() / reach for g in np.mgrid[-reach : reach + 1, -reach : reach + 1])
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    return np.linalg.pinv(basis).astype(np.float32), np.ascontiguousarray(basis.T, np.float32)


@dataclass(frozen=True)
class _Lights:
    """What the laser added in squares around peaks: signal, its inverse variance and burnt (n, p); a start (n, 4)."""

    signal: Array
    weights: Array
    burnt: NDArray[np.bool_]
    start: Array


def _lights(on: Image, off: Image | None, peaks: Peaks, motion: Array, reach: int) -> _Lights:
    size = (2 * reach + 1) ** 2
    signal, weights = np.empty((2, len(peaks), size), np.float32)
    burnt = np.empty(signal.shape, np.bool_)
    start = np.zeros((len(peaks), 4))
    lights(
        _channels(on), _channels(on if off is None else off), GREEN if on.ndim == 3 else 0, off is not None, peaks,
        motion, *_quadratic(reach), (LEAST_VARIANCE, REGISTRATION_PX, BURNT_LEVEL), signal, weights, burnt, start,
    )  # fmt: skip
    return _Lights(signal, weights, burnt, start)


def _channels(image: Image) -> Image:
    return image[:, :, None] if image.ndim == 2 else image


def _measured(on: Image, off: Image | None, peaks: Peaks, motion: Array, shape: Array) -> Spots:
    xx, xy, yy = shape.tolist()
    widest = sqrt(max(xx, yy) / (xx * yy - xy * xy))
    reach = min(max(ceil(2.2 * widest), REACHES[0]), REACHES[1])
    light = _lights(on, off, peaks, motion, reach)
    found, shapes, quality = light.start, np.empty((len(peaks), 3)), np.empty((len(peaks), 4))
    fit_spots(light.signal, light.weights, light.burnt, shape, shapes, False, 5, found, quality)
    uv, sigma = np.empty((len(peaks), 2)), np.empty(len(peaks))
    lone = LONE if off is None else 1.0
    pixels, bound = light.signal.shape[1], reach - 0.6
    keep = believed(peaks, found, quality, pixels, bound, lone, SIGNIFICANT, WORST_PX, APART_PX, uv, sigma)
    return Spots(uv[keep], found[keep, 2], np.hypot(sigma[keep], LEAST_SIGMA_PX), motion, shape)


def _shape(on: Image, off: Image | None, peaks: Peaks, motion: Array, shape: Array) -> Array:
    """The shape (3,) that most of the strongest spots have, from `shape` on."""
    light = _lights(on, off, peaks, motion, SHAPE_REACH)
    shapes, quality, typical = np.empty((len(peaks), 3)), np.empty((len(peaks), 4)), np.empty(3)
    fit_spots(light.signal, light.weights, light.burnt, shape, shapes, True, 5, light.start, quality)
    typical_shape(shapes, typical)
    return typical
