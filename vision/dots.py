"""Finds laser dots to a fraction of a pixel in a laser-on image, with or without a laser-off image of it (2.75)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.motion import halved, motion_between, shifted
from vision.spot_kernels import fit_spots, lights

Array = NDArray[Any]  # of floats
Peaks = NDArray[np.int64]

NEIGHBOURHOOD = 7  # px of the half-size image, what a dot is compared with; about half the spacing of the grid
RING = 4  # px of the half-size image, where a dot of a single laser-on image must have fallen off on every side
SIGNIFICANT = 4.0  # standard deviations, from which a gain of light is no noise
LEAST_NOISE = 0.1  # grey levels, of a 3 × 3 mean of the half-size image
MOST = 180  # candidates kept, the strongest; the grid has 121 dots
USUAL_SHAPE = (0.4, 0.0, 0.4)  # 1/px², before the image has shown its own
SHAPED = 16  # spots of which the shape is learnt
SHAPE_REACH = 6  # px, half the square in which the shape is learnt
BURNT_LEVEL = 90.0  # grey levels, first guess of a spot whose middle is burnt out
REACHES = (4, 8)  # px, least and largest half square in which a spot is measured
REGISTRATION_PX = 0.12  # how far laser-off and laser-on images may lie apart after their motion is made up for
LEAST_VARIANCE = 0.1  # grey levels², of rounding
APART = 4.0  # px, nearer to a stronger one a spot is part of it


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
    """Spots of a laser-on image (h, w) uint8 of working size that its laser-off image, if there is one, does not have;
    the strongest MOST of them.

    reachable (h, w): not zero where the laser's dots can be at all. other: the spots of the other eye, whose motion
    and shape are the first guess here.
    """
    small = halved(on)
    motion = np.zeros(2)
    if off is None:
        peaks = _peaks(_lone(small), 4.0, reachable)
    else:
        small_off = halved(off)
        motion = motion_between(small_off, small, None if other is None else other.motion)
        peaks = _peaks(_response(small_off, small, motion), SIGNIFICANT, reachable)
    shape = np.array(USUAL_SHAPE) if other is None else other.shape
    return _measured(on, off, peaks, motion, shape)


def _response(off: Image, on: Image, motion: Array) -> Array:
    """By how many standard deviations each pixel of the half-size image (h, w) has gained on its neighbourhood. A step
    that the two images may show at slightly different places counts as noise."""
    still = off
    if motion.any():
        still = shifted(off, motion / 2)
    difference = cv2.subtract(on, still, dtype=cv2.CV_32F)
    if motion.any():
        margin = int(np.ceil(np.abs(motion).max() / 2)) + 1
        for border in (difference[:margin], difference[-margin:], difference[:, :margin], difference[:, -margin:]):
            border[:] = 0
    response = cv2.blur(difference, (3, 3)) - cv2.blur(difference, (NEIGHBOURHOOD, NEIGHBOURHOOD))
    noise = max(1.4826 * float(np.median(np.abs(response[2::5, 1::3]))), LEAST_NOISE)
    soft = cv2.blur(still, (3, 3))
    steps = cv2.magnitude(
        cv2.Sobel(soft, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(soft, cv2.CV_32F, 0, 1, scale=0.125)
    )
    return np.asarray(response / cv2.max(cv2.blur(steps, (3, 3)) * (REGISTRATION_PX / 2 / SIGNIFICANT * 4), noise))


def _lone(on: Image) -> Array:
    """How far each pixel of the half-size image stands above the brightest on a ring around it, in standard
    deviations: neither edges nor cables do, for the ring meets them, too."""
    v, u = np.mgrid[-RING : RING + 1, -RING : RING + 1]
    ring = (np.abs(np.hypot(u, v) - RING) < 0.5).astype(np.uint8)
    soft = cv2.GaussianBlur(on, (5, 5), 0)
    response = cv2.subtract(soft, cv2.dilate(soft, ring), dtype=cv2.CV_32F)
    return np.asarray(response)


def _peaks(response: Array, threshold: float, reachable: Image | None) -> Peaks:
    """Local maxima above a threshold in the half-size response: (n, 2) (u, v) of the whole image, the strongest
    first."""
    highest = cv2.dilate(response, np.ones((5, 5), np.uint8))
    found = cv2.findNonZero(
        cv2.bitwise_and(cv2.compare(response, highest, cv2.CMP_EQ), cv2.compare(response, threshold, cv2.CMP_GT))
    )
    if found is None:
        return np.empty((0, 2), np.int64)
    small = found.reshape(-1, 2).astype(np.int64)
    uv = 2 * small
    level = response[small[:, 1], small[:, 0]]
    if reachable is not None:
        can = reachable[np.minimum(uv[:, 1], reachable.shape[0] - 1), np.minimum(uv[:, 0], reachable.shape[1] - 1)] > 0
        uv, level = uv[can], level[can]
    return np.ascontiguousarray(uv[np.argsort(-level, kind="stable")[:MOST]], np.int64)


@lru_cache(maxsize=8)
def _quadratic(reach: int) -> tuple[Array, Array]:
    """(fit (6, p), basis (p, 6)) of a quadratic surface on a square of (2 reach + 1)² pixels."""
    v, u = (g.ravel() / reach for g in np.mgrid[-reach : reach + 1, -reach : reach + 1])
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    return np.linalg.pinv(basis).astype(np.float32), np.ascontiguousarray(basis, np.float32)


@dataclass(frozen=True)
class _Lights:
    """What the laser added in squares around peaks: signal, variance and burnt (n, p)."""

    signal: Array
    variance: Array
    burnt: NDArray[np.bool_]


def _lights(on: Image, off: Image | None, peaks: Peaks, motion: Array, reach: int, noise2: float | None) -> _Lights:
    size = (2 * reach + 1) ** 2
    signal, background, slope2 = (np.empty((len(peaks), size), np.float32) for _ in range(3))
    burnt = np.empty((len(peaks), size), np.bool_)
    variances = np.empty((len(peaks), 2), np.float32)
    lights(
        on, on if off is None else off, off is not None, peaks, motion, *_quadratic(reach), signal, background, slope2,
        burnt, variances,
    )  # fmt: skip
    frames = 1 if off is None else 2
    if noise2 is None:
        noise2 = float(np.median(variances[:, 1])) / frames
    noise2 = max(noise2, LEAST_VARIANCE)
    if off is None:
        return _Lights(signal, np.full_like(signal, noise2), burnt)
    # Wiener's filter (Lee 1980): as much of the laser-off image's detail as exceeds its noise, so that where the
    # blade is plain the noise of only one image counts.
    detail = np.maximum(variances[:, :1] - noise2, 0)
    gain = detail / (detail + noise2)
    signal += (1 - gain) * background
    variance = noise2 * (1 + gain * gain) + (1 - gain) ** 2 * detail
    return _Lights(signal, variance + REGISTRATION_PX**2 * np.maximum(slope2 - noise2 / 2, 0), burnt)


def _measured(on: Image, off: Image | None, peaks: Peaks, motion: Array, shape: Array) -> Spots:
    if len(peaks) == 0:
        return Spots(np.empty((0, 2)), np.empty(0), np.empty(0), motion, shape)
    shape = _shape(on, off, peaks[:SHAPED], motion, shape)
    covariance = np.linalg.inv(shape[[0, 1, 1, 2]].reshape(2, 2))
    widest = float(np.sqrt(max(covariance[0, 0], covariance[1, 1])))
    reach = int(np.clip(np.ceil(2.2 * widest), *REACHES))
    light = _lights(on, off, peaks, motion, reach, None)
    found, quality = _started(light, reach), np.empty((len(peaks), 4))
    shapes = np.tile(shape, (len(peaks), 1))
    fit_spots(light.signal, light.variance, light.burnt, shapes, False, 5, found, quality)
    # the fit's own residuals say how much of the claimed noise is true, as far as so few can
    weight = light.signal.shape[1] / 3
    scale = np.sqrt((20 + weight * quality[:, 3]) / (20 + weight))
    sigma = np.sqrt(0.5 * (quality[:, 0] + quality[:, 1])) * scale
    uv = peaks + found[:, :2]
    keep = (found[:, 2] > 3 * np.sqrt(quality[:, 2]) * scale) & (found[:, 2] > 1.2) & (sigma < 0.8)
    keep &= (np.abs(found[:, :2]) < reach - 0.6).all(axis=1)
    keep &= _first_of_each(uv, APART)
    return Spots(uv[keep], found[keep, 2], np.hypot(sigma[keep], 0.02), motion, shape)


def _started(light: _Lights, reach: int) -> Array:
    """Start (n, 4) of a fit: at the peak, as high as the middle."""
    found = np.zeros((len(light.signal), 4))
    side = 2 * reach + 1
    middle = light.signal.reshape(-1, side, side)[:, reach - 1 : reach + 2, reach - 1 : reach + 2]
    burnt = light.burnt.reshape(-1, side, side)[:, reach, reach]
    found[:, 2] = np.maximum(middle.mean(axis=(1, 2)), np.where(burnt, BURNT_LEVEL, 1.0))
    return found


def _shape(on: Image, off: Image | None, peaks: Peaks, motion: Array, shape: Array) -> Array:
    """The shape (3,) that most of the strongest spots have, from `shape` on."""
    light = _lights(on, off, peaks, motion, SHAPE_REACH, None)
    shapes, quality = np.tile(shape, (len(peaks), 1)), np.empty((len(peaks), 4))
    fit_spots(light.signal, light.variance, light.burnt, shapes, True, 5, _started(light, SHAPE_REACH), quality)
    covariance = np.linalg.inv(shapes[:, [0, 1, 1, 2]].reshape(-1, 2, 2))
    return np.asarray(np.linalg.inv(np.median(covariance, axis=0))[[0, 0, 1], [0, 1, 1]])


def _first_of_each(uv: Array, apart_px: float) -> NDArray[np.bool_]:
    """Which points have no earlier point within a distance."""
    distance = np.hypot(*(uv[:, None] - uv[None]).transpose(2, 0, 1))
    near = np.triu(distance < apart_px, 1)
    return np.asarray(~near.any(axis=0))


def without_spots(on: Image, off: Image, spots: Spots, reach: int = 5) -> Image:
    """The laser-on image (h, w) or (h, w, c) with every spot painted over from the laser-off image, moved as
    `spots.motion` says."""
    height, width = on.shape[:2]
    mask = np.zeros((height, width), np.uint8)
    at = np.rint(spots.uv).astype(int)
    mask[at[:, 1].clip(0, height - 1), at[:, 0].clip(0, width - 1)] = 255
    around = cv2.dilate(mask, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    still = shifted(off, spots.motion).reshape(on.shape) if spots.motion.any() else off
    return np.asarray(cv2.copyTo(still, around, on.copy()), np.uint8).reshape(on.shape)
