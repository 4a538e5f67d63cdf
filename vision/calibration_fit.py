"""What is known of one camera: by its data sheet, and by a fit to views of a board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera

Array = NDArray[np.float64]

CELLS = (8, 6)  # into which an image is divided, across and down, to see where corners were


class CalibrationError(ValueError):
    """The data cannot be calibrated from at all; one line for a person."""


@dataclass(frozen=True)
class Nominal:
    """What the data sheets say: focal length in pixels and distance of the lenses in metres, None where unknown."""

    focal_px: float | None = None
    baseline_m: float | None = None


@dataclass(frozen=True)
class CameraFit:
    """One camera. rms_px: reprojection error; view_rms_px (views,) of each view; residuals (n, 2) px of every corner at
    its place in `corners` (n, 2). focal_sigma_px: of fx as the fit claims, NaN where it was held. tilt (views,): angle
    in radians between the board's normal and the optical axis. coverage (rows, columns): corners per cell of the
    image."""

    camera: Camera
    held: bool
    rms_px: float
    view_rms_px: Array
    corners: Array
    residuals: Array
    focal_sigma_px: float
    tilt: Array
    coverage: NDArray[np.int64]


@dataclass(frozen=True)
class View:
    """How one view fits: reprojection error in px of the left and the right camera, and of both held together; NaN
    where the view did not count. tilt: angle in radians between the board's normal and an optical axis. left_out: why
    it did not count, empty where it did."""

    name: str
    left_px: float = float("nan")
    right_px: float = float("nan")
    together_px: float = float("nan")
    tilt: float = float("nan")
    left_out: str = ""
