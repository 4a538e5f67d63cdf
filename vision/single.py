"""What one photograph with the laser on tells, without a rig: dots with rows and columns, edges, tip; no distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.apart import on_two_surfaces
from vision.bright_spots import without_laser
from vision.candidates import Candidate, weigh
from vision.capture import Image
from vision.cut_end import with_cut_end
from vision.dot_grid import DotGrid, find_dot_grid, resized
from vision.edges import Found, edge_of, find_edges
from vision.evidence import Blade, texture_between
from vision.laser_fan import Fan, fan_of, middle_place
from vision.lattice import Lattice
from vision.lines import hough_lines, sensor_noise, smoothed
from vision.observation import BladeObservation, Dots
from vision.outlined import with_outline
from vision.quality import exposure, sharpness
from vision.reduction import tones
from vision.silhouette import silhouette_of
from vision.stopwatch import Now, Stopwatch
from vision.tip import tip_of

Array = NDArray[Any]  # of floats

LEAST_DOTS = 6
SPACING = 32.0  # px between dots, to which an image is brought before edges are sought in it
MOST_OFF = 1.25  # times: what need not be brought to it
STRAYS = 2.2  # dots that may lie beyond an edge all the same: on a string, say, or on what is behind the blade
BEYOND_PX = 6.0  # a dot's middle may lie so far beyond an edge
WITHIN_PX = 5.0  # so far within an edge a dot would be seen
BORDER_PX = 6.0  # of the image, within which it may not
MOST_MISSING = 0.2  # share of the dots within the edges, beyond which they are not believed
MOST_MISSING_INSIDE = 0.1  # of those within a silhouette that is believed
MOST_LINES = 220
COLOURLESS = 1.5  # grey levels by which colours differ on average in a grey image


def observe_photograph(image: Image, stamp_s: float = 0.0, now: Now | None = None) -> BladeObservation:
    """Dots, edges and tip of a laser-on photograph (h, w) or (h, w, 3); pixels of this image. `valid` means that
    edges were found; distance, points and matches stay None. now: the clock that `elapsed_ms` is told by."""
    watch = Stopwatch(now)
    plain = as_photograph(image)
    watch.lap("reduce")
    grid = find_dot_grid(plain)
    watch.lap("dots")
    if grid is None or grid.lattice is None or len(grid.lattice) < LEAST_DOTS:
        return BladeObservation(stamp_s, False, (_too_few(grid),), elapsed_ms=watch.elapsed_ms)
    lattice = grid.lattice
    clean = without_laser(tones(grid.image), grid.signal, grid.shining())
    factor = SPACING / lattice.spacing
    if 1 / MOST_OFF < factor < MOST_OFF:
        factor = 1.0
    clean = resized(clean, factor).reshape(round(clean.shape[0] * factor), -1, clean.shape[2])
    centre = (np.array(clean.shape[1::-1]) - 1) / 2
    fan = fan_of(grid.spots.uv, lattice)
    dots, places = ((uv + 0.5) * factor - 0.5 - centre for uv in (grid.spots.uv[lattice.member], fan.uv))
    in_view = np.asarray((np.abs(places) < centre - BORDER_PX).all(axis=1), np.bool_)
    middle = middle_place(grid.spots.uv, lattice, (np.array(grid.image.shape[1::-1]) - 1) / 2)
    picture = _Picture.of(clean)
    found = _outline(picture, dots, places, fan, in_view, middle)
    found = _on_one_surface(found, picture, dots, lattice)
    watch.lap("edges")
    edges, axis, to_photograph = found.edges, found.axis, 1 / (factor * grid.scale)
    return BladeObservation(
        stamp_s=stamp_s,
        valid=bool(edges),
        reasons=found.reasons,
        dots_left=_dots(grid, _on_blade(dots, found)),
        edges=tuple(edge_of(edge, to_photograph) for edge in _left_first(edges, axis)),
        tip=None if found.ending is None else tip_of(found.ending, to_photograph),
        heading=axis if edges else None,
        heading_sigma=float(np.deg2rad(1.0 if len(edges) == 2 else 3.0)) if edges else None,
        sharpness=sharpness(clean, edges),
        exposure=exposure(clean, dots + centre),
        elapsed_ms=watch.elapsed_ms,
    )


def grid_of(image: Image) -> Dots | None:
    """The dots of a laser-on image (h, w) or (h, w, 3) with rows and columns counted from the first that is seen."""
    grid = find_dot_grid(as_photograph(image))
    if grid is None or grid.lattice is None:
        return None
    return _dots(grid, np.ones(len(grid.lattice), bool))


def as_photograph(image: Image) -> Image:
    """An image of any kind as (h, w) or (h, w, 3) of bytes: 16 bits are brought to 8, colours that are all alike to
    grey, transparency is left aside."""
    values = np.asarray(image)
    if values.ndim == 3 and values.shape[2] in (1, 2):
        values = values[:, :, 0]
    elif values.ndim == 3:
        values = values[:, :, :3]
    if values.dtype != np.uint8:
        values = np.nan_to_num(values.astype(np.float32), posinf=0.0, neginf=0.0)
        highest = float(values.max(initial=0.0))
        largest = 1.0 if highest <= 1 else 255.0 if highest < 256 else 65535.0 if highest > 4095 else 4095.0
        values = np.clip(np.rint(values * (255.0 / largest)), 0, 255).astype(np.uint8)
    if values.ndim == 3:
        some = values[:: max(values.shape[0] // 256, 1), :: max(values.shape[1] // 256, 1)].astype(np.int16)
        if some.size and float(np.ptp(some, axis=2).mean()) < COLOURLESS:
            values = values[:, :, 1]
    return np.ascontiguousarray(values)


def _on_blade(dots: Array, found: Found) -> NDArray[np.bool_]:
    """Which dots (n, 2) lie on the blade: none that is far beyond an edge does."""
    inside = np.ones(len(dots), bool)
    for edge in found.edges:
        inside &= dots @ edge.outward < edge.rho + BEYOND_PX
    return inside


def _dots(grid: DotGrid, which: NDArray[np.bool_]) -> Dots:
    """Some of the lattice's dots, row by row, counted from the first row and column that is seen."""
    assert grid.lattice is not None
    row, column = grid.lattice.row[which], grid.lattice.column[which]
    order = np.lexsort((column, row))
    return Dots(grid.on_photograph()[which][order], (row - row.min())[order], (column - column.min())[order])


def _too_few(grid: DotGrid | None) -> str:
    if grid is None:
        return "the image is too small to hold dots in a grid"
    count = 0 if grid.lattice is None else len(grid.lattice)
    return f"too few laser dots in a grid: {count} of {len(grid.spots)} bright spots, {LEAST_DOTS} are needed"


@dataclass(frozen=True)
class _Picture:
    """A photograph free of dots (h, w, c), the same smoothed, its noise in grey levels, and its lines (k, 2)."""

    clean: Image
    smooth: Image
    noise: float
    lines: Array

    @classmethod
    def of(cls, clean: Image) -> _Picture:
        noise = sensor_noise(clean)
        return cls(clean, smoothed(clean), noise, hough_lines(clean, noise, MOST_LINES))


def _outline(
    picture: _Picture, dots: Array, places: Array, fan: Fan, in_view: NDArray[np.bool_], middle: Array
) -> Found:
    """Edges and end of the blade that carries dots (n, 2); places (m, 2): where the fan has none; image frame."""
    clean, smooth, noise = picture.clean, picture.smooth, picture.noise
    size = (clean.shape[1], clean.shape[0])
    texture = texture_between(smooth, dots + (np.array(size) - 1) / 2)
    strays = max(Blade.strays, STRAYS / len(dots))
    refused = None
    for absent in (fan.central(middle), fan.certain()):
        blade = Blade(dots, places[absent & in_view], texture, strays=strays, grid_known=False)
        found = find_edges(clean, smooth, blade, None)
        found = with_cut_end(found, weigh(picture.lines, blade, smooth, noise, None), blade, size)
        missing = _share_missing(found, dots, places, fan, in_view)
        if found.edges and missing < MOST_MISSING:
            return _held_against_outline(found, picture, dots, places, fan, in_view)
        if found.edges:
            found = Found(
                (), found.axis, None, (f"no edge: {missing:.0%} of the dots within the likeliest ones are missing",)
            )
        refused = refused or found
    assert refused is not None
    return _held_against_outline(refused, picture, dots, places, fan, in_view)


def _on_one_surface(found: Found, picture: _Picture, dots: Array, lattice: Lattice) -> Found:
    """What was found, or nothing where some of the dots (n, 2) lie on what is behind the blade: its edges then run
    between them, and those found enclose both."""
    if not found.edges or not on_two_surfaces(picture.lines, dots, lattice, picture.smooth, picture.noise):
        return found
    return Found((), found.axis, None, ("no edge: the dots lie on two surfaces, one behind the other",))


def _held_against_outline(
    found: Found, picture: _Picture, dots: Array, places: Array, fan: Fan, in_view: NDArray[np.bool_]
) -> Found:
    """What was found, or what the blade's silhouette tells where the blade stands out from all that is around it and
    no dots are missing on it."""
    half = (np.array(picture.clean.shape[1::-1]) - 1) / 2
    silhouette = silhouette_of(picture.clean, dots + half, picture.noise)
    if silhouette is None:
        return found
    core = cv2.erode(silhouette.mask, np.ones((2 * round(WITHIN_PX) + 1,) * 2, np.uint8))
    across, down = np.rint(np.clip(places + half, 0, 2 * half)).astype(int).T
    count = fan.least_missing(in_view & (core[down, across] > 0))
    if count > MOST_MISSING_INSIDE * (count + len(dots)):
        return found
    return with_outline(found, silhouette, picture.smooth, picture.noise)


def _share_missing(found: Found, dots: Array, places: Array, fan: Fan, in_view: NDArray[np.bool_]) -> float:
    """Share of missing dots among all that lie within edges and end."""
    inside = in_view.copy()
    for edge in found.edges:
        inside &= places @ edge.outward < edge.rho - WITHIN_PX
    if found.ending is not None:
        inside &= places @ found.ending.toward < found.ending.shoulder
    count = fan.least_missing(inside)
    return count / (count + len(dots))


def _left_first(edges: tuple[Candidate, ...], axis: float) -> list[Candidate]:
    left = np.array([np.sin(axis), -np.cos(axis)])
    return sorted(edges, key=lambda edge: -float(edge.outward @ left))
