"""Two calibrated cameras held together: the rigid motion between them from views of a board that both saw at once."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera, StereoPair

Array = NDArray[np.float64]
Pair = tuple[Array, Array]

FEWEST_PAIRS = 3  # that a wrong one can be told among
MOST_APART, LEAST_APART_PX = 4.0, 0.2  # times the error of each camera alone, and more: then pairs do not fit together
MOST_WRONG = 1 / 3  # of the pairs


def between(
    board: Array, pairs: Sequence[Pair], left: Camera, right: Camera, alone_px: float
) -> tuple[Array, Array, Array, float]:
    """The motion between two cameras that stay as they are: rotation (3, 3) and translation (3,) in squares, from left
    to right in OpenCV's axes; error (pairs,) px of each view, NaN of those that do not fit the others and were left
    out; rms px of the others.

    alone_px: error of each camera by itself. Pairs that were not taken at the same time, or whose corners are named
    differently, make the error together far larger; the worst are left out where the others then fit.
    """
    limit = MOST_APART * alone_px + LEAST_APART_PX
    kept = list(range(len(pairs)))
    rms, rotation, shift, errors = _fitted(board, pairs, left, right)
    whole = (rms, rotation, shift, errors)
    while rms > limit and len(kept) - 1 >= max(FEWEST_PAIRS, (1 - MOST_WRONG) * len(pairs)):
        kept.pop(int(np.argmax(errors)))
        rms, rotation, shift, errors = _fitted(board, [pairs[k] for k in kept], left, right)
    if rms > limit:
        kept = list(range(len(pairs)))
        rms, rotation, shift, errors = whole
    by_view = np.full(len(pairs), np.nan)
    by_view[kept] = errors
    return rotation, shift, by_view, rms


def fits_badly(rms_px: float, alone_px: float) -> bool:
    """Whether the cameras together have an error that each of them alone does not explain."""
    return rms_px > MOST_APART * alone_px + LEAST_APART_PX


def epipolar_error(stereo: StereoPair, pairs: Sequence[Pair]) -> float:
    """Root mean square distance (px of the right image without distortion) of points from their partners' epipolar
    lines, those of the essential matrix [t]× R (Longuet-Higgins 1981)."""
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


def _fitted(board: Array, pairs: Sequence[Pair], left: Camera, right: Camera) -> tuple[float, Array, Array, Array]:
    """rms px, rotation (3, 3), translation (3,) in squares, rms px (pairs,) of each view."""
    first, second = ([np.asarray(p[k], np.float32).reshape(-1, 1, 2) for p in pairs] for k in (0, 1))
    found = cv2.stereoCalibrateExtended(
        [np.asarray(board, np.float32)] * len(pairs),
        first,
        second,
        left.matrix,
        np.array(left.distortion),
        right.matrix,
        np.array(right.distortion),
        (left.width, left.height),
        np.eye(3),
        np.zeros(3),
        flags=cv2.CALIB_FIX_INTRINSIC,
    )
    rms, rotation, shift, errors = found[0], found[5], found[6], found[-1]
    by_view = np.sqrt(np.mean(np.square(np.asarray(errors, float).reshape(len(pairs), 2)), axis=1))
    return float(rms), np.asarray(rotation, float), np.asarray(shift, float).reshape(3), by_view
