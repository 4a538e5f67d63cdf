"""What one photograph with the laser on tells, without a rig: dots with rows and columns, edges, tip; no distance."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate
from vision.capture import Image
from vision.edges import edge_of, find_edges
from vision.evidence import Blade, texture_between
from vision.lattice import find_lattice
from vision.lines import sensor_noise, smoothed
from vision.observation import BladeObservation, Dots
from vision.quality import exposure, sharpness
from vision.reduction import green, reduce_image, reduction_factor, tones
from vision.stopwatch import Now, Stopwatch
from vision.tip import tip_of

Array = NDArray[Any]  # of floats

SMALL_WIDTH = 400  # px: a smaller photograph is enlarged, so that its dots have the size they have elsewhere
LEAST_DOTS = 6
TALLEST, WIDEST = 26, 46  # px: the laser stands beside the camera, so its dots are smeared along the rows


def observe_photograph(image: Image, stamp_s: float = 0.0, now: Now | None = None) -> BladeObservation:
    """Dots, edges and tip of a laser-on photograph (h, w) or (h, w, 3); pixels of this image. `valid` means that
    edges were found; distance, points and matches stay None. now: the clock that `elapsed_ms` is told by."""
    watch = Stopwatch(now)
    width = image.shape[1]
    factor = reduction_factor(width)
    scale = 1.0 / factor
    small = reduce_image(image, factor)
    if width < SMALL_WIDTH:
        scale = 612 / width
        small = np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), np.uint8)
    watch.lap("reduce")
    bright = green(small)
    uv, level, background = bright_spots(bright)
    at = np.rint(uv).astype(int)
    around = cv2.blur(background, (9, 9))[at[:, 1].clip(0, len(bright) - 1), at[:, 0].clip(0, bright.shape[1] - 1)]
    lattice = find_lattice(uv, level, around.astype(float))
    watch.lap("dots")
    if lattice is None or len(lattice.member) < LEAST_DOTS:
        count = 0 if lattice is None else len(lattice.member)
        return BladeObservation(
            stamp_s, False, (f"{len(uv)} bright spots, {count} of them in a grid",), elapsed_ms=watch.elapsed_ms
        )
    centre = (np.array(bright.shape[::-1]) - 1) / 2
    seeds = uv[lattice.member]
    clean = _painted(tones(small), background, uv)
    smooth = smoothed(clean)
    inside = (lattice.absent > 4).all(axis=1) & (lattice.absent < 2 * centre - 4).all(axis=1)
    blade = Blade(seeds - centre, lattice.absent[inside] - centre, texture_between(smooth, seeds), 0.1, False)
    found = find_edges(clean, blade, None)
    watch.lap("edges")
    edges = found.edges
    axis, reasons = found.axis, found.reasons
    watch.lap("tip")
    return BladeObservation(
        stamp_s=stamp_s,
        valid=bool(edges),
        reasons=reasons,
        dots_left=Dots((seeds + 0.5) / scale - 0.5, lattice.row, lattice.column),
        edges=tuple(edge_of(edge, 1 / scale) for edge in _left_first(edges, axis)),
        tip=tip_of(found.ending, 1 / scale) if found.ending is not None else None,
        heading=axis if edges else None,
        heading_sigma=float(np.deg2rad(1.0 if len(edges) == 2 else 3.0)) if edges else None,
        sharpness=sharpness(clean, edges),
        exposure=exposure(clean, seeds),
        elapsed_ms=watch.elapsed_ms,
    )


def _left_first(edges: tuple[Candidate, ...], axis: float) -> list[Candidate]:
    left = np.array([np.sin(axis), -np.cos(axis)])
    return sorted(edges, key=lambda edge: -float(edge.outward @ left))


def bright_spots(grey: Image, most: int = 1000) -> tuple[Array, Array, Image]:
    """Small bright spots: centroids (n, 2) px, height above the surroundings (n,), and the image without them.

    A spot is no larger than TALLEST × WIDEST px, which railings, cables and reflections along edges are not."""
    soft = cv2.GaussianBlur(grey, (3, 3), 0)
    kernel = np.ones((TALLEST + 1, WIDEST + 1), np.uint8)
    background = np.asarray(cv2.morphologyEx(soft, cv2.MORPH_OPEN, kernel), np.uint8)
    rise = cv2.subtract(soft, background)
    rise = cv2.subtract(soft, background)
    smooth = cv2.blur(rise, (9, 5))
    highest = cv2.dilate(smooth, np.ones((11, 21), np.uint8))
    threshold = float(np.clip(2.0 * sensor_noise(grey[:, :, None]), 4.0, 8.0))
    _, high = cv2.threshold(smooth, threshold, 255, cv2.THRESH_BINARY)
    top = cv2.bitwise_and(cv2.compare(smooth, highest, cv2.CMP_EQ), high)
    _, _, _, middles = cv2.connectedComponentsWithStats(np.asarray(top, np.uint8))
    peaks = np.rint(middles[1:]).astype(np.int64)
    order = np.argsort(-smooth[peaks[:, 1], peaks[:, 0]].astype(int), kind="stable")[:most]
    peaks = peaks[order]
    uv, level, compact = _centred(rise, peaks)
    apart = np.hypot(*(uv[:, None] - uv[None]).transpose(2, 0, 1))
    compact &= ~np.triu(apart < 8, 1).any(axis=0)
    return uv[compact], level[compact], background


def _centred(rise: Image, peaks: NDArray[np.int64]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Centroid (n, 2) and height (n,) of what stands above 0.4 of each peak, and whether it is a spot and no
    texture."""
    height, width = rise.shape
    dv, du = np.mgrid[-(TALLEST // 2) : TALLEST // 2 + 1, -(WIDEST // 2) : WIDEST // 2 + 1]
    at_u, at_v = peaks[:, 0, None, None] + du, peaks[:, 1, None, None] + dv
    inside = (at_u >= 0) & (at_v >= 0) & (at_u < width) & (at_v < height)
    patch = np.where(inside, rise[np.clip(at_v, 0, height - 1), np.clip(at_u, 0, width - 1)], 0).astype(float)
    middle = patch[:, TALLEST // 2 - 2 : TALLEST // 2 + 3, WIDEST // 2 - 3 : WIDEST // 2 + 4]
    level = middle.max(axis=(1, 2))
    weight = np.maximum(patch - 0.4 * level[:, None, None], 0)
    total = weight.sum(axis=(1, 2)) + 1e-9
    uv = peaks + np.column_stack([(weight * du).sum(axis=(1, 2)) / total, (weight * dv).sum(axis=(1, 2)) / total])
    filled = (weight > 0).mean(axis=(1, 2))
    return uv, level, (filled < 0.4) & (np.abs(uv - peaks) < (WIDEST / 3, TALLEST / 3)).all(axis=1)


def _painted(image: Image, background: Image, uv: Array) -> Image:
    """The tones (h, w, c) with the spots painted over by their surroundings."""
    clean = image.copy()
    across, down = WIDEST // 2, TALLEST // 2
    for u, v in np.rint(uv).astype(int).tolist():
        box = (slice(max(v - down, 0), v + down + 1), slice(max(u - across, 0), u + across + 1))
        clean[box] = np.minimum(clean[box], background[box][:, :, None].astype(int) + 3).astype(np.uint8)
    return clean
