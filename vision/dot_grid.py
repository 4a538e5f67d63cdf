"""The laser's dots in one photograph alone, whatever its scale: sought in the image at several sizes, of which the one
counts whose lattice holds most of the light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.bright_spots import BrightSpots, Signal, bright_spots, laser_signal, measured
from vision.capture import Image
from vision.lattice import Lattice, between, find_lattice, grown_on, kept, onward

Array = NDArray[Any]  # of floats

SIZES = (612, 306, 153)  # px of the longer side: dots are then 20 to 45 px apart in one of them
MANY = 24  # dots, of which an image so small that they lie 20 px apart in it holds hardly as many
MOST_ENLARGED = 2.6
LEAST_SIDE = 24  # px of the shorter side
LEAST_SHARE = 0.25  # of its neighbours' height: a dot where the lattice goes on
ROUNDS = 4  # in which the lattice goes on to fainter dots
APART = 0.12  # of the spacing: nearer to a spot another is part of it
LEAST_CONTRAST, LEAST_CONTRAST_OF_ONE = 1.8, 1.3  # of most dots, and of one, against what lies between dots
FAINTEST = 0.07  # of the usual dot
LEAST_SNR = 2.5  # of a dot where the lattice goes on


@dataclass(frozen=True)
class DotGrid:
    """The spots of an image, the lattice that some of them form, and the image at the size in which they were found,
    scale times the photograph's, with the laser's signal in it."""

    spots: BrightSpots
    lattice: Lattice | None
    image: Image
    scale: float
    signal: Signal

    def on_photograph(self) -> Array:
        """The lattice's dots (n, 2) in pixels of the photograph."""
        assert self.lattice is not None
        return (self.spots.uv[self.lattice.member] + 0.5) / self.scale - 0.5

    def shining(self) -> Array:
        """Where the laser shines on the blade, (n, 2) px: the lattice's dots, and what they mirror between them."""
        assert self.lattice is not None
        member = self.lattice.member
        hull = cv2.convexHull(self.spots.uv[member].astype(np.float32))
        chosen = self.spots.level > 0.1 * float(np.median(self.spots.level[member]))
        chosen &= [cv2.pointPolygonTest(hull, (float(u), float(v)), False) >= 0 for u, v in self.spots.uv]
        chosen[member] = True
        return np.asarray(self.spots.uv[chosen], float)


def find_dot_grid(image: Image) -> DotGrid | None:
    """The dots of an image (h, w) or (h, w, 3); None of one that is too small to hold any."""
    best: DotGrid | None = None
    for size in SIZES:
        if size == SIZES[-1] and best is not None and best.lattice is not None and len(best.lattice) >= MANY:
            break
        scale = size / max(*image.shape[:2], 1)
        if scale > MOST_ENLARGED or scale * min(image.shape[:2]) < LEAST_SIDE:
            continue
        found = _at_size(resized(image, scale), scale)
        if best is None or _worth(found) > _worth(best):
            best = found
    return best


def resized(image: Image, scale: float) -> Image:
    """The image made larger or smaller; pixels are averaged where it gets smaller."""
    if abs(scale - 1) < 1e-9:
        return image
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=way), np.uint8)


def _worth(grid: DotGrid) -> float:
    return 0.0 if grid.lattice is None else grid.lattice.worth


def _at_size(image: Image, scale: float) -> DotGrid:
    """The spots and the lattice that some of them form; its faint dots are sought where it says that they are."""
    signal = laser_signal(image)
    spots = bright_spots(signal)
    around = cv2.medianBlur(image if image.ndim == 2 else np.ascontiguousarray(image[:, :, 1]), 21)
    lattice = find_lattice(spots.uv, spots.level, _shade(around, spots.uv))
    for _ in range(ROUNDS):
        if lattice is None:
            break
        faint = _faint(signal, spots, lattice)
        if not len(faint):
            break
        others = np.setdiff1d(np.arange(len(spots)), lattice.member)
        spots = spots.take(np.concatenate([lattice.member, others])).joined(faint)
        before = len(lattice)
        lattice = grown_on(spots.uv, spots.level, _shade(around, spots.uv), lattice)
        if len(lattice) <= before:
            break
    if lattice is not None:
        lattice = _standing_out(signal, spots, lattice)
    return DotGrid(spots, lattice, image, scale, signal)


def _standing_out(signal: Signal, spots: BrightSpots, lattice: Lattice) -> Lattice | None:
    """The lattice without dots that look no more like dots than what lies between them; None if most are like that."""
    reach = max(2, round(0.15 * lattice.spacing))
    highest = cv2.dilate(signal.blob, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    dots, others = _shade(highest, spots.uv[lattice.member]), _shade(highest, between(spots.uv, lattice))
    ground = float(np.quantile(others, 0.9)) if len(others) else 0.0
    typical = float(np.median(dots))
    if typical < LEAST_CONTRAST * ground:
        return None
    least = max(LEAST_CONTRAST_OF_ONE * ground, FAINTEST * typical)
    return kept(spots.uv, spots.level, lattice, dots > least)


def _faint(signal: Signal, spots: BrightSpots, lattice: Lattice) -> BrightSpots:
    """Summits of the blob response where the lattice would go on, too faint to stand out by themselves."""
    height, width = signal.blob.shape
    reach = max(2, round(0.15 * lattice.spacing))
    typical = float(np.median(spots.level[lattice.member]))
    found = []
    for u, v in np.rint(onward(spots.uv, lattice)).astype(int).tolist():
        if not (reach <= u < width - reach and reach <= v < height - reach):
            continue
        part = signal.blob[v - reach : v + reach + 1, u - reach : u + reach + 1]
        down, across = divmod(int(part.argmax()), part.shape[1])
        if min(down, across) == 0 or max(down, across) == 2 * reach or part.max() < LEAST_SNR * signal.noise:
            continue
        spot = measured(signal, u - reach + across, v - reach + down)
        if spot is None or spot[2] < LEAST_SHARE * typical:
            continue
        if np.hypot(*(spots.uv - spot[:2]).T).min() > APART * lattice.spacing:
            found.append(spot)
    table = np.array(found).reshape(-1, 3)
    return BrightSpots(table[:, :2], table[:, 2], np.zeros(len(table)))


def _shade(around: Array, uv: Array) -> Array:
    height, width = around.shape[:2]
    at = np.rint(uv).astype(int).reshape(-1, 2)
    return np.asarray(around[at[:, 1].clip(0, height - 1), at[:, 0].clip(0, width - 1)], float)
