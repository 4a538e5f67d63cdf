"""What one photograph with the laser on tells, without a rig: dots with rows and columns, edges, tip; no distance."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.bright_spots import BrightSpots, Signal, bright_spots, laser_signal, measured, without_laser
from vision.capture import Image
from vision.lattice import Lattice, find_lattice, grown_on, missing, onward, outer
from vision.observation import BladeObservation, Dots
from vision.quality import exposure
from vision.reduction import green, tones
from vision.silhouette import Side, find_silhouette
from vision.silhouette_view import edge_of, sharpness_of, tip_of
from vision.stopwatch import Now, Stopwatch

Array = NDArray[Any]  # of floats

WORKING_SIZE = 612  # px of the longer side: dots then have the size they have elsewhere
LEAST_DOTS = 6
LEAST_SHARE = 0.25  # of its neighbours' height: a dot where the lattice goes on
ROUNDS = 4  # in which the lattice goes on to fainter dots


def observe_photograph(image: Image, stamp_s: float = 0.0, now: Now | None = None) -> BladeObservation:
    """Dots, edges and tip of a laser-on photograph (h, w) or (h, w, 3); pixels of this image. `valid` means that
    edges were found; distance, points and matches stay None. now: the clock that `elapsed_ms` is told by."""
    watch = Stopwatch(now)
    small, scale = _at_working_size(image)
    watch.lap("reduce")
    signal = laser_signal(small)
    spots, lattice = dots_of(signal, green(small))
    watch.lap("dots")
    if lattice is None or len(lattice) < LEAST_DOTS:
        count = 0 if lattice is None else len(lattice)
        return BladeObservation(
            stamp_s, False, (f"{len(spots)} bright spots, {count} of them in a grid",), elapsed_ms=watch.elapsed_ms
        )
    height, width = small.shape[:2]
    centre = (np.array([width, height]) - 1) / 2
    seeds = spots.uv[lattice.member]
    clean = without_laser(tones(small), signal, _shining(spots, lattice))
    absent = missing(spots.uv, lattice)
    absent = absent[(absent > 4).all(axis=1) & (absent < 2 * centre - 4).all(axis=1)]
    dots = seeds - centre
    outline = find_silhouette(clean, dots, dots[outer(lattice)], absent - centre, lattice.spacing)
    watch.lap("edges")
    edges, axis = outline.edges, outline.axis
    return BladeObservation(
        stamp_s=stamp_s,
        valid=bool(edges),
        reasons=outline.reasons,
        dots_left=Dots((seeds + 0.5) / scale - 0.5, lattice.row, lattice.column),
        edges=tuple(edge_of(edge, 1 / scale) for edge in _left_first(edges, axis)),
        tip=tip_of(outline, dots, 1 / scale),
        heading=axis if edges else None,
        heading_sigma=float(np.deg2rad(1.0 if len(edges) == 2 else 3.0)) if edges else None,
        sharpness=sharpness_of(clean, edges),
        exposure=exposure(clean, seeds),
        elapsed_ms=watch.elapsed_ms,
    )


def grid_of(image: Image) -> Dots | None:
    """The dots of a laser-on image (h, w) or (h, w, 3) with rows and columns counted from the first that is seen."""
    small, scale = _at_working_size(image)
    spots, lattice = dots_of(laser_signal(small), green(small))
    if lattice is None:
        return None
    return Dots((spots.uv[lattice.member] + 0.5) / scale - 0.5, lattice.row, lattice.column)


def dots_of(signal: Signal, bright: Image) -> tuple[BrightSpots, Lattice | None]:
    """The spots and the lattice that some of them form; its faint dots are sought where it says that they are."""
    spots = bright_spots(signal)
    around = cv2.medianBlur(bright, 21)
    lattice = find_lattice(spots.uv, spots.level, _shade(around, spots.uv))
    for _ in range(ROUNDS):
        if lattice is None:
            break
        faint = _faint(signal, spots, lattice)
        if not len(faint):
            break
        others = np.setdiff1d(np.arange(len(spots)), lattice.member)
        order = np.concatenate([lattice.member, others])
        spots = spots.take(order).joined(faint)
        before = len(lattice)
        lattice = grown_on(spots.uv, spots.level, _shade(around, spots.uv), lattice)
        if len(lattice) <= before:
            break
    return spots, lattice


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
        if min(down, across) == 0 or max(down, across) == 2 * reach or part.max() < 2.5 * signal.noise:
            continue
        spot = measured(signal, u - reach + across, v - reach + down)
        if spot is None or spot[2] < LEAST_SHARE * typical:
            continue
        if np.hypot(*(spots.uv - spot[:2]).T).min() > 5:
            found.append(spot)
    table = np.array(found).reshape(-1, 3)
    return BrightSpots(table[:, :2], table[:, 2], np.zeros(len(table)))


def _shining(spots: BrightSpots, lattice: Lattice) -> Array:
    """Where the laser shines on the blade, (n, 2) px: the lattice's dots, and what they mirror between themselves."""
    own = spots.uv[lattice.member]
    bright = spots.level > 0.1 * float(np.median(spots.level[lattice.member]))
    hull = cv2.convexHull(own.astype(np.float32))
    within = [cv2.pointPolygonTest(hull, (float(u), float(v)), False) >= 0 for u, v in spots.uv]
    chosen = bright & np.array(within)
    chosen[lattice.member] = True
    return np.asarray(spots.uv[chosen], float)


def _at_working_size(image: Image) -> tuple[Image, float]:
    """The image with its longer side at WORKING_SIZE, and by how much it was scaled."""
    height, width = image.shape[:2]
    scale = WORKING_SIZE / max(width, height)
    if scale == 1.0:
        return image, 1.0
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=way), np.uint8), scale


def _shade(around: Image, uv: Array) -> Array:
    height, width = around.shape[:2]
    at = np.rint(uv).astype(int).reshape(-1, 2)
    return np.asarray(around[at[:, 1].clip(0, height - 1), at[:, 0].clip(0, width - 1)], float)


def _left_first(edges: tuple[Side, ...], axis: float) -> list[Side]:
    left = np.array([np.sin(axis), -np.cos(axis)])
    return sorted(edges, key=lambda edge: -float(edge.outward @ left))
