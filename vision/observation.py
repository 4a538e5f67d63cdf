"""What one cycle of vision knows of the blade, or why it knows nothing. All pixels are of the full image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Line:
    """A line in the image frame: theta in radians, clockwise from +y_im, is the direction of the normal; rho ≥ 0 in
    pixels."""

    theta: float
    rho: float


@dataclass(frozen=True)
class Edge:
    """One edge of the blade.

    `outward` (2,) is the unit normal (y_im, z_im) that points from the blade to the background: it is
    (cos theta, sin theta) where the image centre lies on the blade's side of the edge, and its opposite where not.
    `support` is the share of the expected edge points that agree with the line. `sigma_theta` rad, `sigma_rho_px` px.
    `ends` (2, 2): the two ends of the supported stretch, in the image frame.
    """

    line: Line
    outward: Array
    sigma_theta: float
    sigma_rho_px: float
    support: float
    ends: Array


@dataclass(frozen=True)
class Tip:
    """The end of the blade: the line across it, and the outermost point (2,) on the blade's axis, in the image
    frame."""

    line: Line
    point: Array
    sigma_px: float


@dataclass(frozen=True)
class Dots:
    """Laser dots in one image: uv (n, 2) in pixels (not the image frame), row (n,) and column (n,) in the laser's
    grid."""

    uv: Array
    row: NDArray[np.int64]
    column: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.uv)


@dataclass(frozen=True)
class BladeObservation:
    """The blade in the left camera's frame at one instant.

    valid: whether distance and edges may be used at all; `reasons` says why not, in plain words.
    dots_left, dots_right: what was found. matches (n, 2): rows and columns of the grid that both eyes saw.
    points (n, 3) m in the camera frame and sigma_m (n,) of their depth x, on the blade alone.
    plane: unit normal (3,) toward the camera and the point (3,) m at which the optical axis meets the surface.
    plane_covariance (3, 3): of (depth at the optical axis m, d depth / d y, d depth / d z).
    distance_m: depth of the surface along the optical axis. nearest_m: least distance from the lens to the surface
    among its dots.
    edges: none, one or two, first the one whose outward normal lies to the left of the axis direction `heading`.
    heading: direction of the blade's axis in the image, radians modulo π. chord_m: between the two edges where both
    are seen.
    sharpness: 0 (blurred, or no edge to judge by) to 1. exposure: mean grey of the blade, 0 to 255; of the whole image
    where no blade was found.
    """

    stamp_s: float
    valid: bool
    reasons: tuple[str, ...] = ()
    dots_left: Dots | None = None
    dots_right: Dots | None = None
    matches: NDArray[np.int64] | None = None
    points: Array | None = None
    sigma_m: Array | None = None
    normal: Array | None = None
    plane_point: Array | None = None
    plane_covariance: Array | None = None
    distance_m: float | None = None
    distance_sigma_m: float | None = None
    nearest_m: float | None = None
    edges: tuple[Edge, ...] = ()
    tip: Tip | None = None
    heading: float | None = None
    heading_sigma: float | None = None
    chord_m: float | None = None
    chord_sigma_m: float | None = None
    sharpness: float = 0.0
    exposure: float = 0.0
    elapsed_ms: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class FarView:
    """The rotor from afar: hub (2,) in the image frame in pixels, and the three directions of the blades there.

    `directions` (3,): radians clockwise from +y_im, from the hub outward, ascending in [0, 2π). sigma per quantity.
    """

    valid: bool
    reasons: tuple[str, ...] = ()
    hub: Array | None = None
    hub_sigma_px: float | None = None
    directions: Array | None = None
    direction_sigma: Array | None = None
    elapsed_ms: Mapping[str, float] = field(default_factory=dict)
