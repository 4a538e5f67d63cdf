"""Finds the blade's tip: a closed outline across the axis, beyond the last dots, at which the edges end too."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.candidates import Blade, Candidate
from vision.capture import Image
from vision.lines import sampled, visible_stretch
from vision.observation import Line, Tip

Array = NDArray[Any]  # of floats

LANES = 25  # across the blade, from edge to edge
STEP = 1.5  # px along a lane
LANE_DOTS = 12.0  # px to each side of a lane within which dots show that the blade goes on
CLOSING = 0.95  # of the blade's width: how far past the ends of its edges a tip may close
BEYOND_MISSING = 8.0  # px: a rounded tip may reach a little past the first missing dot beside it
BORDER = 14.0  # px: an edge that is seen to within this of the image border has not ended
BOX, LONG_BOX = 5, 18  # samples averaged on either side of a step, and on either side to tell it from a streak


@dataclass(frozen=True)
class Outline:
    """The end of the blade: unit vector toward it (2,), the outermost point (2,) on the axis, a line across (outward
    normal (2,), rho), the standard deviation along the axis; image frame, working px. step: its height in grey
    levels."""

    toward: Array
    point: Array
    normal: Array
    rho: float
    sigma_px: float
    step: float = 0.0


def find_tip(smooth: Image, noise: float, edges: tuple[Candidate, ...], axis: float, blade: Blade) -> Outline | None:
    """The tip, or None where the blade leaves the image. axis: direction of the blade in the image, NaN where
    unknown."""
    if np.isnan(axis):
        return None
    ends = [
        _closed_end(smooth, noise, edges, sign * np.array([np.cos(axis), np.sin(axis)]), blade) for sign in (1.0, -1.0)
    ]
    return max((end for end in ends if end is not None), key=lambda end: end.step, default=None)


def _last_and_missing(blade: Blade, toward: Array, low: float, high: float) -> tuple[float, float] | None:
    """(last dot, first missing dot) along the axis in the middle of the strip, None unless dots are missing there, at
    least two of them, and none is seen beyond: then the blade ends in between."""
    if not blade.grid_known or len(blade.absent) == 0:
        return None
    across = np.array([-toward[1], toward[0]])
    middle, reach = (low + high) / 2, 0.36 * (high - low)
    seen = blade.dots[np.abs(blade.dots @ across - middle) < 0.5 * (high - low) + 6] @ toward
    gone = np.sort(blade.absent[np.abs(blade.absent @ across - middle) < max(reach, 10.0)] @ toward)
    gone = gone[gone > seen.max() + 3.0] if len(seen) else gone[:0]
    holes = (
        (blade.absent @ toward < seen.max()) & (np.abs(blade.absent @ across - middle) < reach) if len(seen) else gone
    )
    if len(gone) < 2 or holes.sum() > 0.1 * len(seen):
        return None
    return float(seen.max()), float(gone[0])


def _end_of(edge: Candidate, toward: Array) -> tuple[float, float]:
    """Where along `toward` an edge is last seen, and where it would leave the image."""
    profile, k = edge.profile, edge.index
    direction = profile.direction[k]
    sign = 1.0 if direction @ toward > 0 else -1.0
    order = slice(None) if sign > 0 else slice(None, None, -1)
    t = profile.t[k][order]
    foot = profile.normal[k] * profile.rho[k]
    last = foot + edge.ends[1 if sign > 0 else 0] * direction
    return float(last @ toward), float((foot + t[-1] * direction) @ toward)


def _closed_end(
    smooth: Image, noise: float, edges: tuple[Candidate, ...], toward: Array, blade: Blade
) -> Outline | None:
    height, width = smooth.shape[:2]
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    across = np.array([-toward[1], toward[0]])
    dots = blade.dots
    last_dot = float(np.max(dots @ toward))
    ends = [_end_of(edge, toward) for edge in edges]
    end = min((last for last, _ in ends), default=last_dot)
    low, high = _strip(edges, toward, across, dots, min(end, last_dot + 30.0))
    wide = high - low
    if wide < 16:
        return None
    bracket = _last_and_missing(blade, toward, low, high)
    if bracket is None and (not ends or any(leave - last < BORDER for last, leave in ends)):
        return None
    start, stop = visible_stretch(across[None], np.array([(low + high) / 2]), centre - 3)
    sign = 1.0 if np.array([-across[1], across[0]]) @ toward > 0 else -1.0
    border = float((stop if sign > 0 else -start)[0])
    first = min(end - 0.5 * wide, last_dot) - 3 * BOX
    far = min(border, max(end, last_dot) + 1.6 * wide + 60)
    least = max(4.0, 2.0 * noise, 0.3 * float(np.mean([edge.step for edge in edges] or [0.0])), 1.2 * blade.texture)
    clear = least
    if bracket is not None:
        far = min(border, bracket[1] + max(BEYOND_MISSING, 0.4 * wide) + BOX * STEP)
        least = max(3.0, 1.5 * noise, 0.15 * least)
    outline = None
    if far - first >= 6 * BOX:
        lanes = low + wide * np.linspace(0.06, 0.94, LANES)
        s = np.arange(first, far, STEP)
        u = s * toward[0] + lanes[:, None] * across[0] + centre[0]
        v = s * toward[1] + lanes[:, None] * across[1] + centre[1]
        outside = (u < 1) | (v < 1) | (u > width - 2) | (v > height - 2)
        quiet = _quiet_until(lanes, dots, toward, across, first)
        where, found, size = _lane_ends(sampled(smooth, u, v), outside, s, least, quiet)
        if found.mean() >= 0.6:
            outline = _outline(lanes, where, found, toward, across, last_dot, border, wide)
        if outline is not None:
            outline = replace(outline, step=float(np.median(size[found])))
    reach = float(outline.point @ toward) if outline is not None else np.inf
    if bracket is None:
        return outline if reach < max(last for last, _ in ends) + CLOSING * wide else None
    within = bracket[1] + (
        BEYOND_MISSING if outline is None or outline.step < clear else max(BEYOND_MISSING, 0.4 * wide)
    )
    if outline is not None and bracket[0] - 4 < reach < within:
        return replace(outline, step=outline.step + 1.0)
    return _between(bracket, (low + high) / 2, toward, across)


def _between(bracket: tuple[float, float], lane: float, toward: Array, across: Array) -> Outline:
    """A tip whose outline cannot be seen: somewhere between the last dot and the first one missing."""
    station = sum(bracket) / 2
    spread = (bracket[1] - bracket[0]) / np.sqrt(12) + 2.0
    return Outline(toward, station * toward + lane * across, toward, station, float(spread))


def _quiet_until(lanes: Array, dots: Array, toward: Array, across: Array, first: float) -> Array:
    """How far (lanes,) the blade's own dots reach in each lane: the outline is not before that."""
    beside = np.abs(dots @ across - lanes[:, None]) < LANE_DOTS
    reach = np.where(beside, dots @ toward, -np.inf).max(axis=1)
    return np.asarray(np.maximum(reach + 4.0, first))


def _strip(edges: tuple[Candidate, ...], toward: Array, across: Array, dots: Array, end: float) -> tuple[float, float]:
    """Extent of the blade across its axis at station `end`."""
    beside = dots @ across
    low, high = float(beside.min()) - 4, float(beside.max()) + 4
    for edge in edges:
        slope = edge.outward @ across
        place = (edge.rho - end * (edge.outward @ toward)) / slope
        if slope > 0:
            high = place
        else:
            low = place
    return low, high


def _lane_ends(
    strip: Array, outside: NDArray[np.bool_], s: Array, least: float, from_s: Array
) -> tuple[Array, NDArray[np.bool_], Array]:
    """Where each lane (row of `strip`) steps first and clearly after `from_s`, whether it does, and how much."""
    short, long = _change(strip, BOX), _change(strip, LONG_BOX)
    size = np.where((long > 0.5 * short) & (long > 0.7 * least), short, 0.0)[:, BOX:-BOX]
    place = s[BOX : BOX + size.shape[1]] - STEP / 2
    size[place < from_s[:, None]] = 0
    size[outside[:, BOX : BOX + size.shape[1]]] = 0
    biggest = size.max(axis=1)
    threshold = np.maximum(0.45 * biggest, least)
    reached = size > threshold[:, None]
    first = reached.argmax(axis=1)
    found = reached.any(axis=1)
    index = np.arange(size.shape[1])
    near = (index >= first[:, None]) & (index <= first[:, None] + BOX)
    peak = np.where(near, size, -1).argmax(axis=1)
    inner = np.clip(peak, 1, size.shape[1] - 2)
    rows = np.arange(len(size))
    a, b, c = size[rows, inner - 1], size[rows, inner], size[rows, inner + 1]
    bend = a - 2 * b + c
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(bend < 0, 0.5 * (a - c) / bend, 0.0)
    return place[inner] + STEP * np.clip(shift, -1, 1), found, biggest


def _change(strip: Array, box: int) -> Array:
    """Change (lanes, samples) of the mean over `box` samples before and after each place, of the tone that changes
    most."""
    padded = np.pad(strip, ((0, 0), (box, box), (0, 0)), mode="edge")
    sums = np.cumsum(np.pad(padded, ((0, 0), (1, 0), (0, 0))), axis=1)
    mean = (sums[:, box:] - sums[:, :-box]) / box
    change: Array = np.abs(mean[:, box : box + strip.shape[1]] - mean[:, : strip.shape[1]]).max(axis=2)
    return change


def _outline(
    lanes: Array,
    where: Array,
    found: NDArray[np.bool_],
    toward: Array,
    across: Array,
    last_dot: float,
    border: float,
    wide: float,
) -> Outline | None:
    """An outline that rises to one summit and falls, through the lanes' ends, if they make one."""
    x = (lanes - lanes.mean()) / wide
    median = cv2.medianBlur(where.astype(np.float32)[None], 5)[0].astype(float)
    agree = found & (np.abs(where - median) < 0.06 * wide + 4)
    if agree.mean() < 0.6:
        return None
    summit = int(np.argmax(np.where(agree, median, -np.inf)))
    rise = np.diff(median) * np.where(np.arange(len(lanes) - 1) < summit, 1, -1)
    lane_px = wide * 0.88 / (LANES - 1)
    steady = (rise > -2.0 - 0.3 * lane_px) & (rise < 4.0 * lane_px + 3.0)
    if steady.mean() < 0.8:
        return None
    residual = where - median
    outermost = float(np.sort(where[agree])[-min(2, int(agree.sum()))])
    if outermost < last_dot - 4 or outermost > border - 6:
        return None
    middle = agree & (np.abs(x) < 0.3)
    use = middle if middle.sum() >= 4 else agree
    slope = float(np.polyfit(lanes[use], where[use], 1)[0]) if use.sum() >= 4 else 0.0
    at = float(np.clip(lanes[agree][np.argmax(where[agree])], *np.quantile(lanes, (0.0, 1.0))))
    middle_lane = float(lanes.mean())
    normal = toward - slope * across
    normal /= np.linalg.norm(normal)
    top = outermost * toward + at * across
    point = outermost * toward + middle_lane * across
    scatter = float(np.std(residual[agree])) / np.sqrt(max(agree.sum() / 3, 1)) + 1.0
    return Outline(toward, point, normal, float(normal @ top), scatter)


def tip_of(outline: Outline, factor: float) -> Tip:
    """The outline as a tip in pixels of the full image."""
    normal = outline.normal if outline.rho >= 0 else -outline.normal
    line = Line(float(np.arctan2(normal[1], normal[0])), abs(outline.rho) * factor)
    return Tip(line, outline.point * factor, outline.sigma_px * factor)
