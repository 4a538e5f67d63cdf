"""The region of one photograph that is as bright as the blade between its dots: where a blade stands out from all that
is around it, its outline is told at once, however its edges bend and wherever it ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image

Array = NDArray[Any]  # of floats
Mask = NDArray[np.uint8]

LEVELS = np.geomspace(3.0, 70.0, 14)  # grey levels by which the region may differ from the blade's tone
LEAST_DOTS = 0.9  # share of the dots that lie in the region
MOST_CHANGE = 0.03  # of its area, from one level to the next: else it runs out into what is around it
LEAST_SOLID = 0.95  # of its convex hull: blades have straight or bulging outlines
LEAST_CLEAR = 2.5  # times the noise, grey levels per px, over most of the outline
THINNEST = 7  # px: what is thinner (a cable, a railing) is none of it
BORDER = 3  # px: so near to the image border its outline is not seen
LEAST_CHAIN = 12  # px
SPACING = 2.0  # px between points of an outline
OFFSETS = np.arange(-2.0, 6.5, 0.5)  # px outward of the region, over which its outline's step is looked for
AGREEING = 9  # points of an outline, of which that in the middle is shifted as is the median
PASSES = 6  # of the robust fit of the blade's tone


@dataclass(frozen=True)
class Silhouette:
    """mask (h, w): 1 on the blade. chains: its outline where it is seen, each (n, 2) px and SPACING apart, the blade to
    the right of the way. slope (h, w): how steep the image is, grey levels per px."""

    mask: Mask
    chains: tuple[Array, ...]
    slope: Array

    def within(self, outward: Array, rho: float) -> Silhouette:
        """The silhouette up to a line: normal (2,) and offset in the image frame."""
        height, width = self.mask.shape
        v, u = np.mgrid[0:height, 0:width]
        across = (u - (width - 1) / 2) * outward[0] + (v - (height - 1) / 2) * outward[1]
        mask = np.where(across <= rho, self.mask, 0).astype(np.uint8)
        return _with_chains(mask, self.slope) if mask.any() else self


def silhouette_of(clean: Image, dots: Array, noise: float) -> Silhouette | None:
    """The region of an image (h, w, c), free of dots, that holds the dots (n, 2) px, at the level at which it changes
    least; None where it is not set off from what is around it all along."""
    height, width = clean.shape[:2]
    at = np.rint(dots).astype(int)
    at = at[((at >= 0) & (at < (width, height))).all(axis=1)]
    if len(at) < 4:
        return None
    soft = cv2.GaussianBlur(clean, (0, 0), 1.0).reshape(clean.shape).astype(np.float32)
    off = np.abs(soft - _tone(soft, at)).max(axis=2)
    slope = np.hypot(*(cv2.Sobel(soft, -1, x, y, ksize=3, scale=0.125) for x, y in ((1, 0), (0, 1))))
    slope = slope.reshape(clean.shape).max(axis=2)
    steep = cv2.dilate(slope, np.ones((5, 5), np.uint8))
    regions = [_region(off, level, at) for level in LEVELS]
    areas = [0.0 if region is None else float(region.sum()) for region in regions]
    best: Mask | None = None
    least = MOST_CHANGE
    for k, region in enumerate(regions):
        near = [abs(areas[j] / areas[k] - 1) for j in (k - 1, k + 1) if 0 <= j < len(areas) and areas[k] and areas[j]]
        change = max(near, default=np.inf)
        if region is None or change >= least:
            continue
        outline = _outline(region)
        inner = _inner(outline, width, height)
        if inner.sum() < LEAST_CHAIN or areas[k] < LEAST_SOLID * cv2.contourArea(cv2.convexHull(outline)):
            continue
        across, down = outline[inner].T
        if np.quantile(steep[down, across], 0.1) > LEAST_CLEAR * noise:
            best, least = region, change
    return None if best is None else _with_chains(best, slope)


def _with_chains(mask: Mask, slope: Array) -> Silhouette:
    outline = _outline(mask)
    chains = _chains(outline, _inner(outline, *mask.shape[::-1]))
    return Silhouette(mask, tuple(_on_steps(chain, slope) for chain in chains), slope)


def _tone(soft: Array, at: NDArray[np.int64]) -> Array:
    """The blade's tone (h, w, c): a plane through what is seen at the dots, robustly."""
    height, width = soft.shape[:2]
    v, u = np.mgrid[0:height, 0:width]
    seen = soft[at[:, 1], at[:, 0]].astype(float)
    design = np.column_stack([np.ones(len(at)), at[:, 0] / width - 0.5, at[:, 1] / width - 0.5])
    weight, held = np.ones(len(at)), np.diag([0.0, 1.0, 1.0]) * 2e-4 * len(at)
    for _ in range(PASSES):
        weighted = design * weight[:, None]
        plane = np.linalg.solve(design.T @ weighted + held, weighted.T @ seen)
        residual = np.abs(seen - design @ plane).max(axis=1)
        weight = 1 / (1 + (residual / (2 * (1.4826 * np.median(residual) + 0.5))) ** 2) ** 2
    where = plane[0] + (u / width - 0.5)[..., None] * plane[1] + (v / width - 0.5)[..., None] * plane[2]
    return np.asarray(where, np.float32)


def _region(off: Array, level: float, at: NDArray[np.int64]) -> Mask | None:
    """The region with most of the dots in it, its holes filled; None where it has too few."""
    near = (off < level).astype(np.uint8)
    near = np.asarray(cv2.morphologyEx(near, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)), np.uint8)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (THINNEST, THINNEST))
    near = np.asarray(cv2.morphologyEx(near, cv2.MORPH_OPEN, disc), np.uint8)
    count, labels = cv2.connectedComponents(near, connectivity=4)
    own = np.bincount(labels[at[:, 1], at[:, 0]], minlength=count)
    own[0] = 0
    best = int(own.argmax())
    if own[best] == 0:
        return None
    region = (labels == best).astype(np.uint8)
    filled = np.asarray(cv2.drawContours(np.zeros_like(region), [_outline(region)], 0, 1, cv2.FILLED), np.uint8)
    return filled if filled[at[:, 1], at[:, 0]].mean() >= LEAST_DOTS else None


def _outline(region: Mask) -> NDArray[np.int32]:
    """The outline (n, 2) px of a region in one piece."""
    outlines, _ = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(max(outlines, key=len)[:, 0], np.int32)


def _inner(outline: NDArray[np.int32], width: int, height: int) -> NDArray[np.bool_]:
    return np.asarray(((outline >= BORDER) & (outline < (width - BORDER, height - BORDER))).all(axis=1))


def _chains(outline: NDArray[np.int32], inner: NDArray[np.bool_]) -> tuple[Array, ...]:
    """The stretches of an outline that are inside the image."""
    outline, inner = outline[::-1], inner[::-1]  # cv2 leaves the region to the left, as v runs down
    first = 0 if inner.all() else int(np.flatnonzero(~inner)[0])
    outline, inner = np.roll(outline, -first, axis=0), np.roll(inner, -first)
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], inner, [False]]).astype(int)))
    pairs = zip(bounds[::2].tolist(), bounds[1::2].tolist(), strict=True)
    return tuple(_even(outline[a:b].astype(float)) for a, b in pairs if b - a >= LEAST_CHAIN)


def _even(chain: Array) -> Array:
    """A chain (n, 2) of pixels as a smooth one, evenly spaced."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(chain, axis=0).T))])
    smooth = np.column_stack([np.convolve(np.pad(line, 2, mode="edge"), np.full(5, 0.2), "valid") for line in chain.T])
    places = np.arange(0.0, way[-1], SPACING)
    return np.column_stack([np.interp(places, way, line) for line in smooth.T])


def _on_steps(chain: Array, slope: Array) -> Array:
    """A chain (n, 2), the blade to its right, moved onto the steepest slope beside it."""
    way = np.gradient(chain, axis=0)
    outward = np.column_stack([way[:, 1], -way[:, 0]]) / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    at = chain[:, None] + OFFSETS[None, :, None] * outward[:, None]
    steep = cv2.remap(slope, at[..., 0].astype(np.float32), at[..., 1].astype(np.float32), cv2.INTER_LINEAR)
    moved = np.pad(OFFSETS[steep.argmax(axis=1)], AGREEING // 2, mode="edge")
    shift = np.median(np.lib.stride_tricks.sliding_window_view(moved, AGREEING), axis=1)
    return np.asarray(chain + shift[:, None] * outward)
