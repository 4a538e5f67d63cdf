"""Finds laser dots to a fraction of a pixel in the difference between a laser-on and a laser-off image (2.75)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image

Array = NDArray[Any]  # of floats

NEIGHBOURHOOD = 7  # px of the half-size image, what a dot is compared with; about half the spacing of the grid
REACH = 4  # px, half the window of the centroid
LIFT = 48  # grey levels added to the difference, so that noise below zero is not lost
MOST = 180  # candidates kept, the strongest; the grid has 121 dots
LARGEST_MOTION = 12.0  # px between laser-off and laser-on


@dataclass(frozen=True)
class Spots:
    """Bright compact spots that the laser may have made: uv (n, 2) px, level above the surroundings, sigma_px (n,).

    motion (2,) px brings the laser-off image onto the laser-on image."""

    uv: Array
    level: Array
    sigma_px: Array
    motion: Array

    def __len__(self) -> int:
        return len(self.uv)


def motion_between(off: Image, on: Image) -> Array:
    """Shift (2,) px that brings the laser-off image onto the laser-on image: by phase correlation of small images.

    Zero where the images do not support a shift: it must bring them clearly closer together.
    """
    return 2 * _motion(_half(off), _half(on))


def _half(image: Image) -> Image:
    return np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)


def _motion(off: Image, on: Image) -> Array:
    """The shift between half-size images: coarse at half their size, then fine at their own."""
    small = [cv2.blur(_half(image), (3, 3)) for image in (off, on)]
    motion = _correlated(small[0], small[1])
    if not 0.05 < np.hypot(*motion) < LARGEST_MOTION / 4:
        return np.zeros(2)
    if _difference(small[0], small[1], motion) > 0.95 * _difference(small[0], small[1], np.zeros(2)):
        return np.zeros(2)
    coarse = 2 * motion
    moved = shifted(off, coarse)
    rest = _correlated(moved, on)
    if np.hypot(*rest) < 1.5 and _difference(off, on, coarse + rest) < _difference(moved, on, np.zeros(2)):
        return coarse + rest
    return coarse


def _correlated(first: Image, second: Image) -> Array:
    window = cv2.createHanningWindow((first.shape[1], first.shape[0]), cv2.CV_32F)
    shift, _ = cv2.phaseCorrelate(first.astype(np.float32), second.astype(np.float32), window)
    return np.array(shift)


def _difference(off: Image, on: Image, shift: Array) -> float:
    inner = slice(4, -4)
    moved = shifted(off, shift) if shift.any() else off
    return float(cv2.norm(moved[inner, inner], on[inner, inner], cv2.NORM_L1))


def shifted(image: Image, motion: Array) -> Image:
    """The image moved by (right, down) px."""
    transform = np.array([[1.0, 0.0, motion[0]], [0.0, 1.0, motion[1]]])
    moved = cv2.warpAffine(
        image, transform, (image.shape[1], image.shape[0]), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(moved, np.uint8)


def find_spots(off: Image, on: Image, reachable: Image | None = None, hint: Array | None = None) -> Spots:
    """Spots that are in `on` and not in `off`, both (h, w) uint8 of working size; the strongest MOST of them.

    reachable (h, w): not zero where the laser's dots can be at all. hint (2,) px: motion that the other eye
    found. Spots are found in images of half the size and measured in the whole ones.
    """
    small_off, small_on = _half(off), _half(on)
    motion = 2 * _motion(small_off, small_on)
    if hint is not None and np.hypot(*(hint - motion)) > 1.0:
        own, other = (_difference(small_off, small_on, shift / 2) for shift in (motion, hint))
        motion = hint if other < own else motion
    still = off
    if motion.any():
        small_off, still = shifted(small_off, motion / 2), shifted(off, motion)
    difference = cv2.addWeighted(small_on, 1.0, small_off, -1.0, LIFT)
    if motion.any():
        margin = int(np.ceil(np.abs(motion).max() / 2)) + 1
        for border in (difference[:margin], difference[-margin:], difference[:, :margin], difference[:, -margin:]):
            border[:] = LIFT
    response = cv2.subtract(cv2.blur(difference, (3, 3)), cv2.blur(difference, (NEIGHBOURHOOD, NEIGHBOURHOOD)))
    typical = float(np.mean(np.minimum(response[::3, ::3], 6)))  # what moved against its background tells no noise
    return _centroids(on, still, _peaks(np.asarray(response, np.uint8), max(2.0, 6.0 * typical), reachable), motion)


def _peaks(response: Image, threshold: float, reachable: Image | None) -> NDArray[np.int64]:
    """Local maxima above a threshold in the half-size response: (n, 2) (u, v) of the whole image, the strongest
    first."""
    highest = cv2.dilate(response, np.ones((5, 5), np.uint8))
    _, strong = cv2.threshold(response, threshold, 255, cv2.THRESH_BINARY)
    mask = cv2.bitwise_and(cv2.compare(response, highest, cv2.CMP_EQ), strong)
    found = cv2.findNonZero(mask)
    if found is None:
        return np.empty((0, 2), np.int64)
    small = found.reshape(-1, 2).astype(np.int64)
    uv = 2 * small
    level = response[small[:, 1], small[:, 0]].astype(np.int64)
    if reachable is not None:
        can = reachable[np.minimum(uv[:, 1], reachable.shape[0] - 1), np.minimum(uv[:, 0], reachable.shape[1] - 1)] > 0
        uv, level = uv[can], level[can]
    return np.asarray(uv[np.argsort(-level, kind="stable")[:MOST]], np.int64)


def _centroids(on: Image, off: Image, peaks: NDArray[np.int64], motion: Array) -> Spots:
    height, width = on.shape
    inside = (peaks[:, 0] >= 2) & (peaks[:, 1] >= 2) & (peaks[:, 0] < width - 2) & (peaks[:, 1] < height - 2)
    peaks = peaks[inside]
    if len(peaks) == 0:
        return Spots(np.empty((0, 2)), np.empty(0), np.empty(0), motion)
    reach = np.arange(-REACH, REACH + 1)
    dv, du = np.meshgrid(reach, reach, indexing="ij")
    x0, y0 = du.astype(np.float32), dv.astype(np.float32)
    v = np.clip(peaks[:, 1, None, None] + dv, 0, height - 1)
    u = np.clip(peaks[:, 0, None, None] + du, 0, width - 1)
    patch = on[v, u].astype(np.float32) - off[v, u].astype(np.float32)
    ring = np.hypot(dv, du) > REACH - 0.3
    around = patch[:, ring]
    base = np.median(around, axis=1)
    noise = 1.4826 * np.median(np.abs(around - base[:, None]), axis=1) + 0.25
    patch -= base[:, None, None]
    centre = np.zeros((len(peaks), 2), np.float32)
    for width_px in (2.6, 2.2, 2.0):
        distance2 = (x0 - centre[:, 0, None, None]) ** 2 + (y0 - centre[:, 1, None, None]) ** 2
        weight = np.maximum(patch, 0) * np.exp(distance2 * np.float32(-0.5 / width_px**2))
        total = weight.sum(axis=(1, 2)) + 1e-6
        offset = np.stack([(weight * x0).sum(axis=(1, 2)), (weight * y0).sum(axis=(1, 2))], axis=1) / total[:, None]
        # a window on a spot of like width halves the offset: twice the step, kept within the patch
        centre = np.clip(centre + 1.7 * (offset - centre), -2.7, 2.7)
    spread2 = 0.5 * (weight * distance2).sum(axis=(1, 2)) / total
    spread2 = 1 / np.maximum(1 / np.maximum(spread2, 0.5) - 1 / width_px**2, 0.12)
    strong = slice(0, max(12, len(peaks) // 4))
    width2 = float(np.clip(np.median(spread2[strong]), 0.7, 6.0))
    burnt = off[v, u] > 247
    centre, level, sigma = _fitted(patch, ~burnt, x0, y0, centre, width2, noise)
    keep = (level > 0.8 * noise) & (level > 1.2) & (sigma < 0.8)
    uv = peaks + centre
    keep &= _first_of_each(uv, 4.0)
    return Spots(uv[keep], level[keep].astype(float), sigma[keep], motion)


def _fitted(
    patch: NDArray[np.float32],
    usable: NDArray[np.bool_],
    du: NDArray[np.float32],
    dv: NDArray[np.float32],
    centre: NDArray[np.float32],
    width2: float,
    noise: Array,
) -> tuple[Array, Array, Array]:
    """Centre (n, 2), height and standard deviation of the centre of round Gaussian spots of variance `width2` px², by
    Gauss and Newton from `centre`; pixels that are not `usable` (burnt out) do not count."""
    level = np.zeros(len(patch), np.float32)
    for step in range(2):
        x, y = du - centre[:, 0, None, None], dv - centre[:, 1, None, None]
        distance2 = x * x + y * y
        shape = np.exp(distance2 * np.float32(-0.5 / width2))
        use = usable * np.exp(distance2 * np.float32(-0.2 / width2))
        if step == 0:
            level = (use * shape * patch).sum(axis=(1, 2)) / ((use * shape * shape).sum(axis=(1, 2)) + 1e-6)
        gain = (np.maximum(level, 1.0) / np.float32(width2))[:, None, None]
        slopes = np.stack([shape, gain * x * shape, gain * y * shape], axis=1).reshape(len(patch), 3, -1)
        weighted = slopes * use.reshape(len(patch), 1, -1)
        normal = weighted @ slopes.transpose(0, 2, 1) + np.float32(1e-3) * np.eye(3, dtype=np.float32)
        residual = (patch - level[:, None, None] * shape).reshape(len(patch), -1, 1)
        change = np.linalg.solve(normal, weighted @ residual)[..., 0]
        level = level + change[:, 0]
        centre = np.clip(centre + np.clip(change[:, 1:], -0.7, 0.7), -3.5, 3.5)
    inverse = np.linalg.inv(normal)
    spread = inverse @ (weighted @ weighted.transpose(0, 2, 1)) @ inverse
    sigma = (
        0.8 * np.sqrt(0.5 * (spread[:, 1, 1] + spread[:, 2, 2])) * noise
    )  # the ring holds the tails of the spot, too
    return centre.astype(float), level.astype(float), np.hypot(sigma, 0.04).astype(float)


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
