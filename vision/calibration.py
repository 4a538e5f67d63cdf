"""Stereo calibration from a chessboard seen by both cameras (Zhang 2000), and how far the result may be trusted.

Few views, or views that are hardly tilted, leave focal length and distance to trade places: the fit looks good and is
wrong. Then the focal lengths are held at the lens's nominal one instead of being fitted, and the result says so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.board import BoardViews
from vision.calibration_doubts import WANTED_VIEWS, conditions_of, doubts_of, doubts_of_pair
from vision.calibration_fit import CELLS, CalibrationError, CameraFit, Nominal, View
from vision.calibration_pairs import between, epipolar_error
from vision.camchain import stereo_of_opencv
from vision.camera import Camera, StereoPair

Array = NDArray[np.float64]
Choice = Literal["auto", "free", "held"]

FEWEST_VIEWS = 3
ROUGH_VIEW, ROUGH_PX = 4.0, 0.3  # times the usual error, and px: beyond both a view's corners are no board's
HOPELESS = 0.004  # of the image's width: an error that no pair has whose focal lengths are known
EYES = ("left", "right")


@dataclass(frozen=True)
class StereoFit:
    """The calibrated pair. epipolar_px: rms distance of corners from the epipolar line of their partner. free: both
    cameras with nothing held, for comparison; held: the same at the nominal focal length, None where it is unknown.
    chosen: which of the two the result is built on. warnings: in plain words, why it may not be trusted. square_m:
    length of a square, from the board or from the nominal baseline. views: every view, those that did not count too."""

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
    views: tuple[View, ...]


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
    conditioned. Views that do not fit the others, of one camera or of the pair, are left out.

    Raises: CalibrationError: too few views, no scale, cameras that do not fit together, or 'held' without a nominal
    focal length.
    """
    nominal = nominal or Nominal()
    if choice == "held" and nominal.focal_px is None:
        raise CalibrationError("a held fit needs the nominal focal length (focal length in mm over pixel size in mm)")
    if views.square_m is None and nominal.baseline_m is None:
        raise CalibrationError(
            "the size of a square is unknown, and so is the nominal baseline: one of them gives the scale"
        )
    sides = [
        {k: corners for k, corners in enumerate(side) if corners is not None} for side in (views.left, views.right)
    ]
    free, rough = zip(*(_fitting(views, side) for side in sides), strict=True)
    seen = [{k: corners for k, corners in side.items() if k not in bad} for side, bad in zip(sides, rough, strict=True)]
    held = None
    if nominal.focal_px is not None:
        held = [fit_camera(views.board, [*side.values()], views.image_size, nominal.focal_px) for side in seen]
    doubts = doubts_of(free[0], free[1], nominal)
    chosen: Literal["free", "held"] = "held" if choice == "held" or (choice == "auto" and doubts and held) else "free"
    left, right = held if chosen == "held" and held is not None else free
    for name, fit in zip(EYES, (left, right), strict=True):
        if fit.rms_px > HOPELESS * fit.camera.width:
            raise CalibrationError(
                f"the corners in the {name} images miss those of the board by {fit.rms_px:.0f} px: "
                "are they listed in the order of the board's?"
            )
    both = [k for k in seen[0] if k in seen[1]]
    if not both:
        raise CalibrationError("no view shows the board to both cameras")
    pairs = [(seen[0][k], seen[1][k]) for k in both]
    alone = max(left.rms_px, right.rms_px)
    rotation, shift, together, rms = between(views.board, pairs, left.camera, right.camera, alone)
    if not doubts and rms > HOPELESS * left.camera.width:
        raise CalibrationError(
            f"the two cameras do not fit together: {rms:.1f} px, where each alone has {alone:.2f} px: were both "
            "pictures of a pair taken at the same time, and their corners listed alike?"
        )
    square = (
        views.square_m if views.square_m is not None else (nominal.baseline_m or 0.0) / float(np.linalg.norm(shift))
    )
    stereo = stereo_of_opencv(left.camera, right.camera, rotation, shift * square)
    warnings = [
        *doubts,
        *conditions_of(free[0], free[1], doubted=bool(doubts)),
        *doubts_of_pair(stereo, rms, alone, views.square_m, square, nominal),
    ]
    if doubts:
        kept = f"the focal length is held at the nominal {nominal.focal_px:.0f} px" if chosen == "held" else ""
        offer = "" if held else "; give the lens's (--focal-mm and --pixel-um), and they are held there"
        warnings.append(kept or f"the free fit is used all the same: do not trust its focal lengths{offer}")
    used = [pair for pair, error in zip(pairs, together, strict=True) if np.isfinite(error)]
    return StereoFit(
        stereo,
        left,
        right,
        rms,
        epipolar_error(stereo, used),
        (free[0], free[1]),
        None if held is None else (held[0], held[1]),
        chosen,
        square,
        "board" if views.square_m is not None else "baseline",
        tuple(warnings),
        _listed(views, (left, right), seen, dict(zip(both, together.tolist(), strict=True)), rough),
    )


def _fitting(views: BoardViews, side: Mapping[int, Array]) -> tuple[CameraFit, set[int]]:
    """One camera's free fit to its views, by number, and which of them it is not built on: a blurred or half covered
    board misleads the search for its corners."""
    bad: set[int] = set()
    while True:
        kept = [k for k in side if k not in bad]
        fit = fit_camera(views.board, [side[k] for k in kept], views.image_size)
        limit = max(ROUGH_VIEW * float(np.median(fit.view_rms_px)), ROUGH_PX)
        rough = {k for k, error in zip(kept, fit.view_rms_px, strict=True) if error > limit}
        if not rough or len(kept) - len(rough) < max(FEWEST_VIEWS, 2 / 3 * len(side)):
            return fit, bad
        bad |= rough


def _listed(
    views: BoardViews,
    fits: tuple[CameraFit, CameraFit],
    seen: Sequence[Mapping[int, Array]],
    together: Mapping[int, float],
    rough: Sequence[set[int]],
) -> tuple[View, ...]:
    """Every view with its errors."""
    errors = [dict(zip(side, fit.view_rms_px.tolist(), strict=True)) for side, fit in zip(seen, fits, strict=True)]
    tilts = [dict(zip(side, fit.tilt.tolist(), strict=True)) for side, fit in zip(seen, fits, strict=True)]
    nan = float("nan")
    listed = []
    for k, pair in enumerate(zip(views.left, views.right, strict=True)):
        why = [f"no board in the {side} picture" for side, corners in zip(EYES, pair, strict=True) if corners is None]
        why += [
            f"the corners of the {side} picture do not fit" for side, bad in zip(EYES, rough, strict=True) if k in bad
        ]
        if k in together and not np.isfinite(together[k]):
            why.append("left and right do not belong together")
        tilt = tilts[0].get(k, tilts[1].get(k, nan))
        listed.append(
            View(
                views.name(k), errors[0].get(k, nan), errors[1].get(k, nan), together.get(k, nan), tilt, ", ".join(why)
            )
        )
    return tuple(listed)


def _coverage(corners: Array, image_size: tuple[int, int]) -> NDArray[np.int64]:
    """Corners (rows, columns) in each cell of the image."""
    columns, rows = CELLS
    cell = np.clip((corners / image_size * CELLS).astype(int), 0, (columns - 1, rows - 1))
    counts = np.zeros((rows, columns), np.int64)
    np.add.at(counts, (cell[:, 1], cell[:, 0]), 1)
    return counts
