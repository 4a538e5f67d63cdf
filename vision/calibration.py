"""Stereo calibration from a chessboard seen by both cameras, and how far the result may be trusted.

Few views, or views that are hardly tilted, leave focal length and distance to trade places: the fit looks good and is
wrong. Then the focal lengths are held at the lens's nominal one instead of being fitted, and the result says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.board import BoardViews
from vision.calibration_doubts import WANTED_VIEWS, doubts_of
from vision.calibration_fit import CELLS, CameraFit, Nominal
from vision.camchain import stereo_of_opencv
from vision.camera import Camera, StereoPair

Array = NDArray[np.float64]
Choice = Literal["auto", "free", "held"]

FEWEST_VIEWS = 3


class CalibrationError(ValueError):
    """The data cannot be calibrated from at all; one line for a person."""


@dataclass(frozen=True)
class StereoFit:
    """The calibrated pair. epipolar_px: rms distance of corners from the epipolar line of their partner. free: both
    cameras with nothing held, for comparison; held: the same at the nominal focal length, None where it is unknown.
    chosen: which of the two the result is built on. warnings: in plain words, why it may not be trusted. square_m:
    length of a square, from the board or from the nominal baseline."""

    stereo: StereoPair
    left: CameraFit
    right: CameraFit
    rms_px: float
    epipolar_px: float
    free: tuple[CameraFit, CameraFit]
    held: tuple[CameraFit, CameraFit] | None
    chosen: Literal["free", "held"]
    square_m: float
    scale_from: Literal["board", "baseline"]
    warnings: tuple[str, ...]


def fit_camera(
    board: Array, views: Sequence[Array], image_size: tuple[int, int], focal_px: float | None = None
) -> CameraFit:
    """One camera from its views (n, 2) each; with `focal_px` the focal length is held there, the principal point at the
    image centre and tangential distortion at zero.

    Raises: CalibrationError: too few views, or none that a camera could have seen.
    """
    if len(views) < FEWEST_VIEWS:
        raise CalibrationError(
            f"{len(views)} views of the board; at least {FEWEST_VIEWS} are needed, {WANTED_VIEWS} wanted"
        )
    width, height = image_size
    guess = focal_px or 1.0 * width
    matrix = np.array([[guess, 0, (width - 1) / 2], [0, guess, (height - 1) / 2], [0, 0, 1.0]])
    flags = cv2.CALIB_FIX_K3
    if focal_px is not None:
        flags |= cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_FOCAL_LENGTH | cv2.CALIB_FIX_PRINCIPAL_POINT
        flags |= cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K2
    points = [np.asarray(view, np.float32).reshape(-1, 1, 2) for view in views]
    try:
        rms, matrix, distortion, turns, shifts, deviations, _, per_view = cv2.calibrateCameraExtended(
            [np.asarray(board, np.float32)] * len(views), points, (width, height), matrix, np.zeros(5), flags=flags
        )
    except cv2.error as error:
        raise CalibrationError(f"no camera could have seen these corners ({error.err})") from None
    k1, k2, p1, p2 = np.asarray(distortion, float).ravel()[:4]
    camera = Camera(
        width,
        height,
        float(matrix[0, 0]),
        float(matrix[1, 1]),
        float(matrix[0, 2]),
        float(matrix[1, 2]),
        (float(k1), float(k2), float(p1), float(p2)),
    )
    corners = np.concatenate([np.asarray(view, float).reshape(-1, 2) for view in views])
    drawn = [
        cv2.projectPoints(board, turn, shift, matrix, distortion)[0].reshape(-1, 2)
        for turn, shift in zip(turns, shifts, strict=True)
    ]
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    return CameraFit(
        camera,
        focal_px is not None,
        float(rms),
        np.asarray(per_view, float).ravel(),
        corners,
        np.concatenate(drawn) - corners,
        float("nan") if focal_px is not None else float(np.asarray(deviations).ravel()[0]),
        np.arccos(np.clip(np.abs(normals[:, 2]), 0, 1)),
        _coverage(corners, image_size),
    )


def calibrate_stereo(views: BoardViews, nominal: Nominal | None = None, choice: Choice = "auto") -> StereoFit:
    """Both cameras and the rigid motion between them, rotation kept.

    choice: 'free' fits the focal lengths, 'held' keeps the nominal one, 'auto' takes 'free' unless its data are badly
    conditioned.

    Raises: CalibrationError: too few views, no scale, or 'held' without a nominal focal length.
    """
    nominal = nominal or Nominal()
    if choice == "held" and nominal.focal_px is None:
        raise CalibrationError("a held fit needs the nominal focal length (focal length in mm over pixel size in mm)")
    if views.square_m is None and nominal.baseline_m is None:
        raise CalibrationError(
            "the size of a square is unknown, and so is the nominal baseline: one of them gives the scale"
        )
    sides = (views.left, views.right)
    seen = [[corners for corners in side if corners is not None] for side in sides]
    free = tuple(fit_camera(views.board, side, views.image_size) for side in seen)
    held = None
    if nominal.focal_px is not None:
        held = tuple(fit_camera(views.board, side, views.image_size, nominal.focal_px) for side in seen)
    doubts = doubts_of(free[0], free[1], nominal)
    chosen: Literal["free", "held"] = "held" if choice == "held" or (choice == "auto" and doubts and held) else "free"
    left, right = held if chosen == "held" and held is not None else free
    both = [(a, b) for a, b in zip(views.left, views.right, strict=True) if a is not None and b is not None]
    if not both:
        raise CalibrationError("no view shows the board to both cameras")
    rms, rotation, shift = _between(views.board, both, left.camera, right.camera)
    apart = float(np.linalg.norm(shift))
    square = views.square_m if views.square_m is not None else (nominal.baseline_m or 0.0) / apart
    stereo = stereo_of_opencv(left.camera, right.camera, rotation, shift * square)
    warnings = list(doubts)
    if views.square_m is None:
        warnings.append(
            f"the square's size is not given; the nominal baseline, itself not measured, makes it {square * 1e3:.1f} mm"
        )
    elif nominal.baseline_m is not None and abs(stereo.baseline_m / nominal.baseline_m - 1) > 0.05:
        warnings.append(
            f"the baseline comes out as {stereo.baseline_m * 1000:.1f} mm, nominal {nominal.baseline_m * 1000:.1f} mm"
        )
    if doubts:
        kept = f"the focal length is held at the nominal {nominal.focal_px:.0f} px" if chosen == "held" else ""
        warnings.append(kept or "the free fit is used all the same: do not trust its focal lengths")
    epipolar = epipolar_error(stereo, both)
    scale_from: Literal["board", "baseline"] = "board" if views.square_m is not None else "baseline"
    return StereoFit(
        stereo,
        left,
        right,
        rms,
        epipolar,
        (free[0], free[1]),
        None if held is None else (held[0], held[1]),
        chosen,
        square,
        scale_from,
        tuple(warnings),
    )


def epipolar_error(stereo: StereoPair, pairs: Sequence[tuple[Array, Array]]) -> float:
    """Root mean square distance (px of the right image without distortion) of points from their partners' epipolar
    lines."""
    t = stereo.translation
    cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    essential = cross @ stereo.rotation
    off = []
    for left, right in pairs:
        lines = stereo.left.rays(left) @ essential.T
        rays = stereo.right.rays(right)
        distance = (rays * lines).sum(axis=1) / np.hypot(lines[:, 1], lines[:, 2])
        off.append(distance * stereo.right.fx)
    return float(np.sqrt(np.mean(np.square(np.concatenate(off)))))


def _between(
    board: Array, pairs: Sequence[tuple[Array, Array]], left: Camera, right: Camera
) -> tuple[float, Array, Array]:
    """rms px, rotation (3, 3) and translation (3,) in squares from left to right in OpenCV's axes, intrinsics as they
    are."""
    first, second = ([np.asarray(p[k], np.float32).reshape(-1, 1, 2) for p in pairs] for k in (0, 1))
    rms, _, _, _, _, rotation, shift, _, _ = cv2.stereoCalibrate(
        [np.asarray(board, np.float32)] * len(pairs),
        first,
        second,
        left.matrix,
        np.array(left.distortion),
        right.matrix,
        np.array(right.distortion),
        (left.width, left.height),
        flags=cv2.CALIB_FIX_INTRINSIC,
    )
    return float(rms), np.asarray(rotation, float), np.asarray(shift, float).reshape(3)


def _coverage(corners: Array, image_size: tuple[int, int]) -> NDArray[np.int64]:
    """Corners (rows, columns) in each cell of the image."""
    columns, rows = CELLS
    cell = np.clip((corners / image_size * CELLS).astype(int), 0, (columns - 1, rows - 1))
    counts = np.zeros((rows, columns), np.int64)
    np.add.at(counts, (cell[:, 1], cell[:, 0]), 1)
    return counts
