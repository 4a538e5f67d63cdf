"""Cameras, the stereo pair and the laser's grid, in the camera frame: x along the optical axis, y right, z down.

Pixels are (u, v), u to the right and v down, with (0, 0) at the *centre* of the first pixel, as in OpenCV. The
image frame of this project has its origin at the image centre, `((width - 1) / 2, (height - 1) / 2)`, with the same
axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bayer = Literal["rggb", "bggr", "grbg", "gbrg"]
Lens = Literal["radtan", "equidistant"]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera whose lens bends as OpenCV and Kalibr have it. lens: radtan, the radial-tangential distortion
    (k1, k2, p1, p2; Brown 1966), or equidistant, that of fisheye lenses (k1, k2, k3, k4; Kannala and Brandt 2006)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    lens: Lens = "radtan"

    @property
    def bends(self) -> bool:
        """Whether straight lines may be bent in its image."""
        return self.lens == "equidistant" or any(self.distortion)

    @property
    def pinhole(self) -> Camera:
        """The camera with a lens that bends nothing."""
        return replace(self, distortion=(0.0, 0.0, 0.0, 0.0), lens="radtan")

    @property
    def centre(self) -> Array:
        """The image centre in pixels (2,)."""
        return np.array([(self.width - 1) / 2, (self.height - 1) / 2])

    @property
    def matrix(self) -> Array:
        """The intrinsic matrix (3, 3) for OpenCV's axes (right, down, forward)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def project(self, points: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) in metres in this camera's frame. Points at or behind the lens give NaN."""
        points = np.asarray(points, float).reshape(-1, 3)
        depth = points[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            y, z = points[:, 1] / depth, points[:, 2] / depth
        pixels = np.empty((len(points), 2))
        yd, zd = self._bent(y, z) if self.bends else (y, z)
        pixels[:, 0] = self.fx * yd + self.cx
        pixels[:, 1] = self.fy * zd + self.cy
        pixels[depth <= 0] = np.nan
        return pixels

    def rays(self, pixels: Array) -> Array:
        """Directions (n, 3), scaled to x = 1, of pixels (n, 2): the inverse of `project` up to the depth. A pixel
        beyond all that the lens can see gets the ray of one near it."""
        pixels = np.asarray(pixels, float).reshape(-1, 2)
        if len(pixels) == 0:
            return np.empty((0, 3))
        yz = (pixels - (self.cx, self.cy)) / (self.fx, self.fy)
        if self.bends:
            from vision import lens_kernels  # here, so that checking a mission file does not load a compiler

            bent, yz = yz, np.empty_like(yz)
            unbent = lens_kernels.unbent_radtan if self.lens == "radtan" else lens_kernels.unbent_equidistant
            unbent(bent, np.array(self.distortion), yz)
        rays = np.empty((len(yz), 3))
        rays[:, 0], rays[:, 1:] = 1.0, yz
        return rays

    def _bent(self, y: Array, z: Array) -> tuple[Array, Array]:
        """Where the lens bends places (n,), (n,) in focal lengths off the optical axis to."""
        yy, zz = y * y, z * z
        if self.lens == "equidistant":
            k1, k2, k3, k4 = self.distortion
            off_axis = np.sqrt(yy + zz)
            angle = np.arctan(off_axis)
            s = angle * angle
            bent = angle * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
            share = np.divide(bent, off_axis, out=np.ones_like(bent), where=off_axis > 1e-12)
            return y * share, z * share
        k1, k2, p1, p2 = self.distortion
        r2, yz = yy + zz, y * z
        radial = 1 + r2 * (k1 + k2 * r2)
        return y * radial + 2 * p1 * yz + p2 * (r2 + 2 * yy), z * radial + p1 * (r2 + 2 * zz) + 2 * p2 * yz

    def shrunk(self, factor: int) -> Camera:
        """The camera whose image is this one's averaged over blocks of factor × factor pixels (INTER_AREA)."""
        return replace(
            self,
            width=self.width // factor,
            height=self.height // factor,
            fx=self.fx / factor,
            fy=self.fy / factor,
            cx=(self.cx + 0.5) / factor - 0.5,
            cy=(self.cy + 0.5) / factor - 0.5,
        )


@dataclass(frozen=True)
class StereoPair:
    """Two cameras. A point p of the left camera's frame is `rotation @ p + translation` in the right camera's frame.

    rotation (3, 3) and translation (3,) in metres, both in camera axes (x forward, y right, z down). With a right
    camera displaced by the baseline T to the right, and no rotation, translation is (0, -T, 0).
    """

    left: Camera
    right: Camera
    rotation: Array = field(default_factory=lambda: np.eye(3))
    translation: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def baseline_m(self) -> float:
        """Distance between the two lenses."""
        return float(np.linalg.norm(self.translation))

    def shrunk(self, factor: int) -> StereoPair:
        """The same pair seen through images averaged over blocks of factor × factor pixels."""
        return replace(self, left=self.left.shrunk(factor), right=self.right.shrunk(factor))


@dataclass(frozen=True)
class LaserGrid:
    """A laser that throws rows × columns dots, evenly spaced on a wall at right angles to its axis.

    fan: full angles (across the columns, across the rows) in radians. position (3,) in metres and rotation (3, 3),
    laser axes to camera axes, place it in the left camera's frame; its own axes are x forward, y right, z down.
    Row 0 is the top row, column 0 the leftmost.
    """

    rows: int = 11
    columns: int = 11
    fan: tuple[float, float] = (np.deg2rad(28.2), np.deg2rad(28.2))
    position: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    def directions(self) -> Array:
        """Unit directions (rows, columns, 3) of the rays in the left camera's frame."""
        return self._directions.copy()

    @cached_property
    def _directions(self) -> Array:
        across = np.tan(self.fan[0] / 2) * np.linspace(-1, 1, self.columns)
        down = np.tan(self.fan[1] / 2) * np.linspace(-1, 1, self.rows)
        rays = np.empty((self.rows, self.columns, 3))
        rays[..., 0] = 1
        rays[..., 1] = across[None, :]
        rays[..., 2] = down[:, None]
        rays /= np.linalg.norm(rays, axis=2, keepdims=True)
        directions: Array = rays @ self.rotation.T
        return directions


@dataclass(frozen=True)
class RigGeometry:
    """What vision needs to know of a rig: the stereo pair (full-resolution images) and the laser, None without one.

    bayer: images with one channel are the raw mosaic of colour cameras, and these are the colours of its first two
    rows' first two pixels; None: they are grey."""

    stereo: StereoPair
    laser: LaserGrid | None = None
    bayer: Bayer | None = None
