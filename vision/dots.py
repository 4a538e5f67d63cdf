"""Finds laser dots to a fraction of a pixel in a laser-on image, with or without a laser-off image of it (2.75)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.motion import halved, motion_between
from vision.peaks import Peaks, gained, standing_out
from vision.spot_fit import first_of_each, fit_spots
from vision.spot_light import lights, weighed

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


def find_spots(off: Image | None, on: Image, reachable: Image | None = None, other: Spots | None = None) -> Spots:
    """Spots of a laser-on image (h, w) uint8 of working size that its laser-off image, if there is one, does not have.

    reachable (h, w): not zero where the laser's dots can be at all. other: the spots of the other eye, whose motion
    and shape are the first guess here.
    """
    small = halved(on)
    motion = np.zeros(2)
    if reachable is None:
        reachable = np.full(on.shape, 255, np.uint8)
    if off is None:
        peaks = standing_out(small, reachable)
    else:
        small_off = halved(off)
        motion = motion_between(small_off, small, None if other is None else other.motion)
        peaks = gained(small_off, small, motion, reachable)
    shape = np.array(USUAL_SHAPE) if other is None else other.shape
    if len(peaks) == 0:
        return Spots(np.empty((0, 2)), np.empty(0), np.empty(0), motion, shape)
    # not the strongest alone: those may be what two images of a steep background have left
    some = peaks[: len(peaks) * 2 // 3 : max(len(peaks) * 2 // 3 // SHAPED, 1)]
    shape = _shape(on, off, some if len(some) > 2 else peaks, motion, shape)
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
    side = 2 * reach + 1
    signal, background, weights = (np.empty((len(peaks), side * side), np.float32) for _ in range(3))
    burnt = np.empty(signal.shape, np.bool_)
    about = np.empty((len(peaks), 2), np.float32)
    lights(
        on, on if off is None else off, off is not None, peaks, motion, *_quadratic(reach), signal, background,
        weights, burnt, about,
    )  # fmt: skip
    noise2 = max(float(np.median(about[:, 1])) / (1 if off is None else 2), LEAST_VARIANCE)
    if off is None:
        weights[:] = 1 / noise2
    else:
        weighed(signal, background, weights, about, noise2, REGISTRATION_PX)
    middle = side * reach + reach
    start = np.zeros((len(peaks), 4))
    start[:, 2] = np.maximum(
        (signal[:, middle - 1] + signal[:, middle] + signal[:, middle + 1]) / 3,
        np.where(burnt[:, middle], BURNT_LEVEL, 1.0),
    )
    return _Lights(signal, weights, burnt, start)


def _measured(on: Image, off: Image | None, peaks: Peaks, motion: Array, shape: Array) -> Spots:
    determinant = shape[0] * shape[2] - shape[1] ** 2
    widest = float(np.sqrt(max(shape[0], shape[2]) / determinant))
    reach = int(np.clip(np.ceil(2.2 * widest), *REACHES))
    light = _lights(on, off, peaks, motion, reach)
    found, quality = light.start, np.empty((len(peaks), 4))
    fit_spots(light.signal, light.weights, light.burnt, np.tile(shape, (len(peaks), 1)), False, 5, found, quality)
    # the fit's own residuals say how much of the claimed noise is true, as far as so few can
    weight = light.signal.shape[1] / 3
    scale = np.sqrt((20 + weight * quality[:, 3]) / (20 + weight))
    if off is None:
        scale *= LONE
    sigma = np.sqrt(0.5 * (quality[:, 0] + quality[:, 1])) * scale
    keep = (found[:, 2] > SIGNIFICANT * np.sqrt(quality[:, 2]) * scale) & (sigma < WORST_PX)
    keep &= (np.abs(found[:, :2]) < reach - 0.6).all(axis=1)
    uv = peaks + found[:, :2]
    first_of_each(uv, APART_PX, keep)
    return Spots(uv[keep], found[keep, 2], np.hypot(sigma[keep], 0.02), motion, shape)


def _shape(on: Image, off: Image | None, peaks: Peaks, motion: Array, shape: Array) -> Array:
    """The shape (3,) that most of the strongest spots have, from `shape` on."""
    light = _lights(on, off, peaks, motion, SHAPE_REACH)
    shapes, quality = np.tile(shape, (len(peaks), 1)), np.empty((len(peaks), 4))
    fit_spots(light.signal, light.weights, light.burnt, shapes, True, 5, light.start, quality)
    determinant = shapes[:, 0] * shapes[:, 2] - shapes[:, 1] ** 2
    uu, uv, vv = np.median(shapes / determinant[:, None], axis=0)  # of the inverses: (vv, -uv, uu)
    result: Array = np.array([uu, uv, vv]) / (uu * vv - uv * uv)
    return result
