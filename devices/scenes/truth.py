"""What is true of a close-up scene, computed from its geometry alone and never from its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.scenes.background import Background
from devices.scenes.blade import BladePiece
from vision.camera import Camera, LaserGrid, StereoPair
from vision.observation import Dots, Line

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EdgeTruth:
    """A straight edge as the left image shows it: its tangent where it is nearest to the image centre, and
    `outward`."""

    line: Line
    outward: Array
    visible_px: float


@dataclass(frozen=True)
class SceneTruth:
    """All of it at the instant of the laser-on images, in pixels of the left image and metres of the left camera's
    frame.

    points (n, 3) with rows and columns as in `dots_left`/`dots_right`: NaN where an eye does not see the dot.
    on_blade (n,): false for dots on what stands behind. distance_m: None where the optical axis misses the surface's
    outline. tip_point_px (2,): image frame, None where it is not in view. heading: toward the tip, image frame.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    points: Array
    uv_left: Array
    uv_right: Array
    on_blade: NDArray[np.bool_]
    edges: tuple[EdgeTruth, ...]
    tip_point_px: Array | None
    tip_m: Array | None
    heading: float
    distance_m: float
    centre_on_blade: bool
    normal: Array
    chord_m: float

    def dots(self, side: str) -> Dots:
        """The dots that this eye sees, on the blade and behind it."""
        uv = self.uv_left if side == "left" else self.uv_right
        seen = np.isfinite(uv[:, 0])
        return Dots(uv[seen], self.row[seen], self.column[seen])


def line_through(point: Array, direction: Array) -> Line:
    """The line (θ, ρ) through a point of the image frame, along a direction (2.28)."""
    normal = np.array([-direction[1], direction[0]]) / np.hypot(*direction)
    rho = float(normal @ point)
    if rho < 0:
        normal, rho = -normal, -rho
    return Line(float(np.arctan2(normal[1], normal[0])), rho)


def _in_image(camera: Camera, uv: Array) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):
        return (uv[:, 0] >= 0) & (uv[:, 1] >= 0) & (uv[:, 0] <= camera.width - 1) & (uv[:, 1] <= camera.height - 1)


def scene_truth(blade: BladePiece, background: Background, stereo: StereoPair, laser: LaserGrid) -> SceneTruth:
    """The truth of a scene, from the blade, what stands behind it, and the rig."""
    settings = blade.settings
    right_eye = -stereo.rotation.T @ stereo.translation
    rays = laser.directions().reshape(-1, 3)
    row, column = (index.ravel() for index in np.mgrid[: laser.rows, : laser.columns])
    t, s, n = blade.meet(laser.position, rays)
    on_blade = np.isfinite(t) & (blade.inside(s, n) > 0)
    points = laser.position + np.where(on_blade, t, np.nan)[:, None] * rays
    if background.has_strip:
        reach = (background.near_m - laser.position[0]) / rays[:, 0]
        behind = laser.position + reach[:, None] * rays
        y, z = (behind[:, 1] / behind[:, 0]).astype(np.float32), (behind[:, 2] / behind[:, 0]).astype(np.float32)
        hit = ~on_blade & (background.strip(y, z) > 0)
        points[hit] = behind[hit]
    uv = []
    for camera, eye in ((stereo.left, np.zeros(3)), (stereo.right, right_eye)):
        seen_from = points - eye
        pixels = camera.project(np.where(np.isfinite(seen_from), seen_from, -1.0))
        tb, sb, nb = blade.meet(eye, seen_from)
        with np.errstate(invalid="ignore"):
            hidden = ~on_blade & np.isfinite(tb) & (tb < 1) & (blade.inside(sb, nb) > 0)
        pixels[~_in_image(camera, pixels) | hidden] = np.nan
        uv.append(pixels)
    keep = np.isfinite(uv[0][:, 0]) | np.isfinite(uv[1][:, 0])
    stations = np.linspace(-8, 8, 4001)
    if settings.tip_m is not None:
        stations = np.linspace(-8, settings.tip_m - blade.tip_length, 4001)
    edges = []
    widths = blade.half_widths(stations)
    for side, width in ((1.0, widths[0]), (-1.0, widths[1])):
        edge_points = blade.point(stations, settings.centre_m + side * width)
        pixels = stereo.left.project(edge_points) - stereo.left.centre
        ahead = (
            np.abs(edge_points[:, 1:] / np.maximum(edge_points[:, :1], 0.1)).max(axis=1) < 0.7
        )  # distortion folds beyond
        visible = _in_image(stereo.left, pixels + stereo.left.centre) & (width > 0) & ahead
        if visible.sum() < 3:
            continue
        pixels = pixels[visible]
        length = float(np.linalg.norm(np.diff(pixels, axis=0), axis=1).sum())
        nearest = int(np.clip(np.argmin(np.linalg.norm(pixels, axis=1)), 1, len(pixels) - 2))
        direction = pixels[nearest + 1] - pixels[nearest - 1]
        outward = side * np.array([-direction[1], direction[0]]) / np.hypot(*direction)
        edges.append(EdgeTruth(line_through(pixels[nearest], direction), outward, length))
    middle = np.array([0.0, 0.1])
    trace = stereo.left.project(blade.point(middle, np.full(2, settings.centre_m)))
    heading = float(np.arctan2(*(trace[1] - trace[0])[::-1]))
    tip_point = tip_m = None
    if settings.tip_m is not None:
        tip_m = blade.point(np.array([settings.tip_m]), np.array([settings.centre_m]))
        pixel = stereo.left.project(tip_m)
        if _in_image(stereo.left, pixel)[0]:
            tip_point = pixel[0] - stereo.left.centre
        tip_m = tip_m[0]
    t0, s0, n0 = blade.meet(np.zeros(3), np.array([[1.0, 0.0, 0.0]]))
    bulge = 2 * settings.curvature * (n0[0] - settings.centre_m)
    normal = blade.normal + bulge * blade.across
    return SceneTruth(
        row[keep],
        column[keep],
        points[keep],
        uv[0][keep],
        uv[1][keep],
        on_blade[keep],
        tuple(edges),
        tip_point,
        tip_m,
        heading,
        float(t0[0]),
        bool(blade.inside(s0, n0)[0] > 0),
        normal / np.linalg.norm(normal),
        settings.chord_m + (settings.taper[0] + settings.taper[1]) * float(s0[0]),
    )
