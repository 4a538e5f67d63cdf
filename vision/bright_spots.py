"""Small bright spots of one image alone: where a laser's dots may be, among whatever else shines.

A dot is bright in every direction against its surroundings: both curvatures of the brightness are negative there, which
tells it from edges, railings and cables at any angle. It may be a streak where the laser grazes the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.lines import sensor_noise

Array = NDArray[Any]  # of floats

LONGEST = 32  # px, of a streak where dots are 20 to 45 px apart
SCALES = (1.3, 2.6)  # px: of a dot, and of a streak
AROUND = 25  # px: window in which a spot is compared with what is around it
APART_PX = 5.0  # nearer to one that stands out more a spot is part of it
MOST_AREA = 0.4 * LONGEST**2  # px, of a spot
LEAST_SNR, LEAST_ISOLATION = 3.0, 2.2
SHARES = (0.4, 0.55, 0.7, 0.8)  # of its height above which pixels belong to a spot, the first at which it is no larger


@dataclass(frozen=True)
class Signal:
    """How much of the laser is in each pixel, (h, w) float32 in grey levels: `rise` above what is around it at most
    LONGEST px wide, `blob`: how much it looks like a spot there, in the same unit, and the noise in `blob`."""

    rise: Array
    blob: Array
    noise: float


@dataclass(frozen=True)
class BrightSpots:
    """Centroids uv (n, 2) px, heights level (n,) above the surroundings, and isolation (n,): how much each stands out
    among its surroundings, best first."""

    uv: Array
    level: Array
    isolation: Array

    def __len__(self) -> int:
        return len(self.uv)

    def take(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> BrightSpots:
        """Some of them."""
        return BrightSpots(self.uv[which], self.level[which], self.isolation[which])

    def joined(self, more: BrightSpots) -> BrightSpots:
        """These, then more."""
        return BrightSpots(*(np.concatenate([one, two]) for one, two in zip(_parts(self), _parts(more), strict=True)))


def _parts(spots: BrightSpots) -> tuple[Array, Array, Array]:
    return spots.uv, spots.level, spots.isolation


def laser_signal(image: Image) -> Signal:
    """The signal of an image (h, w) or (h, w, 3). In colour the laser is what has more of one colour than its
    surroundings, or is so bright that it has burnt out to white."""
    if image.ndim == 2:
        noise = sensor_noise(image[:, :, None])
        rise = _rise(image.astype(np.float32))
    else:
        noise = sensor_noise(np.ascontiguousarray(image[:, :, 1:2]))
        total = image.sum(axis=2, dtype=np.float32)
        highest = image.max(axis=2).astype(np.float32)
        rise = np.maximum(0.5 * _rise(highest), _rise(1.5 * highest - 0.5 * total))
    blob = np.zeros_like(rise)
    for sigma in SCALES:
        blob = np.maximum(blob, _blob(rise, sigma))
    # Of the response to white noise at the finer scale.
    return Signal(rise, blob, max(0.12 * noise, 0.08))


def bright_spots(signal: Signal, most: int = 320) -> BrightSpots:
    """The spots that stand out most among their surroundings."""
    blob = signal.blob
    box = (AROUND, AROUND)
    mean = cv2.blur(blob, box)
    spread = cv2.blur(cv2.absdiff(blob, mean), box)
    isolation = (blob - mean) / np.maximum(spread, signal.noise)
    highest = cv2.dilate(blob, np.ones((7, 7), np.uint8))
    top = (blob >= highest) & (blob > LEAST_SNR * signal.noise) & (isolation > LEAST_ISOLATION)
    v, u = np.nonzero(top)
    order = np.argsort(-isolation[v, u], kind="stable")[: most + most // 4]
    found = [measured(signal, int(u[k]), int(v[k])) for k in order]
    good = [k for k, spot in enumerate(found) if spot is not None]
    uv = np.array([found[k][:2] for k in good]).reshape(-1, 2)  # type: ignore[index]
    level = np.array([found[k][2] for k in good])  # type: ignore[index]
    stands = isolation[v[order[good]], u[order[good]]] if good else np.zeros(0)
    apart = np.hypot(*(uv[:, None] - uv[None]).transpose(2, 0, 1))
    alone = ~np.triu(apart < APART_PX, 1).any(axis=0) if len(uv) else np.zeros(0, bool)
    return BrightSpots(uv[alone][:most], level[alone][:most], stands[alone][:most])


def measured(signal: Signal, u: int, v: int) -> tuple[float, float, float] | None:
    """(u, v, level) of the spot whose summit is at a pixel; None where what is bright there goes on further than a
    dot."""
    left, upper, patch = _around(signal, u, v)
    level = _summit(patch, u - left, v - upper)
    found = _own(patch, u - left, v - upper, level)
    if found is None:
        return None
    own, floor = found
    weight = np.where(own, np.maximum(patch - floor, 0.02 * level), 0)
    total = float(weight.sum()) + 1e-9
    mu = float((weight.sum(axis=0) * np.arange(weight.shape[1])).sum()) / total
    mv = float((weight.sum(axis=1) * np.arange(weight.shape[0])).sum()) / total
    return left + mu, upper + mv, level


def without_laser(image: Image, signal: Signal, uv: Array) -> Image:
    """The image (h, w, c) with spots at uv (n, 2) filled from what surrounds them, never brighter than before."""
    mask = np.zeros(image.shape[:2], np.uint8)
    for u, v in np.rint(uv).astype(int).tolist():
        left, upper, patch = _around(signal, u, v)
        found = _own(patch, u - left, v - upper, _summit(patch, u - left, v - upper), (0.15, *SHARES))
        if found is not None:
            mask[upper : upper + patch.shape[0], left : left + patch.shape[1]] |= found[0].astype(np.uint8)
    mask = np.asarray(cv2.dilate(mask, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (7, 7))), np.uint8)
    filled = [cv2.inpaint(np.ascontiguousarray(plane), mask, 3, cv2.INPAINT_TELEA) for plane in cv2.split(image)]
    return np.asarray(np.minimum(np.dstack(filled), image), np.uint8)


def _around(signal: Signal, u: int, v: int) -> tuple[int, int, Array]:
    """First column and row of the window about a pixel, and what rises in it."""
    half = LONGEST // 2 + 2
    left, upper = max(u - half, 0), max(v - half, 0)
    return left, upper, signal.rise[upper : v + half + 1, left : u + half + 1]


def _summit(patch: Array, u: int, v: int) -> float:
    return float(patch[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2].mean())


def _own(
    patch: Array, u: int, v: int, level: float, shares: tuple[float, ...] = SHARES
) -> tuple[NDArray[np.bool_], float] | None:
    """What belongs to the spot with its summit at (u, v), and the height above which it does: the lowest at which it
    is no larger than a dot, None where there is no such."""
    for share in shares:
        mask = (patch > share * level).astype(np.uint8)
        mask[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2] = 1
        _, labels, boxes, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        label = int(labels[v, u])
        _, _, wide, high, area = boxes[label].tolist()
        if max(wide, high) <= LONGEST and area < MOST_AREA:
            return np.asarray(labels == label), share * level
    return None


def _rise(plane: Array) -> Array:
    """What stands above its surroundings and is less than LONGEST px wide (h, w)."""
    soft = cv2.GaussianBlur(plane, (0, 0), 0.8)
    kernel = np.ones((LONGEST + 1, LONGEST + 1), np.uint8)
    return np.asarray(soft - cv2.morphologyEx(soft, cv2.MORPH_OPEN, kernel), np.float32)


def _blob(rise: Array, sigma: float) -> Array:
    """The smaller of the two downward curvatures (h, w), times sigma squared: 0 on edges and lines."""
    soft = cv2.GaussianBlur(rise, (0, 0), sigma)
    xx = cv2.filter2D(soft, cv2.CV_32F, np.array([[1.0, -2.0, 1.0]]))
    yy = cv2.filter2D(soft, cv2.CV_32F, np.array([[1.0], [-2.0], [1.0]]))
    xy = cv2.filter2D(soft, cv2.CV_32F, np.array([[0.25, 0, -0.25], [0, 0, 0], [-0.25, 0, 0.25]]))
    largest = 0.5 * (xx + yy) + np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    return np.asarray(sigma**2 * np.maximum(-largest, 0), np.float32)
