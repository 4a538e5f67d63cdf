"""The chessboard that cameras are calibrated from: its corners on the board, and in a picture."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SEARCH_PX = 1000  # the board is looked for in pictures no wider than this


@dataclass(frozen=True)
class BoardViews:
    """Corners of one board seen by both cameras at the same instants.

    image_size (width, height). board (n, 3): the corners on the board, in units of one square. left, right: for each
    view (n, 2) in pixels, or None where that camera did not see the whole board. square_m: the length of a square where
    known. names: what the views are called; by their numbers where there are none.
    """

    image_size: tuple[int, int]
    board: Array
    left: tuple[Array | None, ...]
    right: tuple[Array | None, ...]
    square_m: float | None = None
    names: tuple[str, ...] = ()

    def name(self, view: int) -> str:
        """What a view is called."""
        return self.names[view] if self.names else f"view {view + 1}"


def find_corners(image: NDArray[np.uint8], columns: int, rows: int) -> Array | None:
    """Inner corners (rows * columns, 2) of a chessboard in a picture, row by row, to a fraction of a pixel; None where
    the whole board is not in view."""
    grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
    factor = max(1, -(-grey.shape[1] // SEARCH_PX))
    small = grey if factor == 1 else cv2.resize(grey, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
    found, rough = cv2.findChessboardCornersSB(small, (columns, rows))
    if not found:
        return None
    corners = np.asarray((np.asarray(rough).reshape(-1, 2) + 0.5) * factor - 0.5, np.float32)
    spacing = float(np.linalg.norm(np.diff(corners.reshape(rows, columns, 2), axis=1), axis=2).min())
    reach = int(np.clip(spacing / 4, 2, 15))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-3)
    refined = cv2.cornerSubPix(grey, corners.reshape(-1, 1, 2), (reach, reach), (-1, -1), stop)
    return np.asarray(refined, float).reshape(-1, 2)


def turned_alike(left: Array, right: Array, columns: int, rows: int) -> Array:
    """The corners (rows * columns, 2) that the right camera saw, counted from the corner of the board that the left one
    counts from: two cameras side by side see the board turned nearly alike. A board that looks the same upside down, of
    an even number of corners both ways or an odd one, is else counted from either end."""
    grid = right.reshape(rows, columns, 2)
    ways = [np.rot90(grid, quarter) for quarter in ((0, 2) if columns != rows else range(4))]
    centred = left - left.mean(axis=0)
    best = max(ways, key=lambda way: float((centred * (way.reshape(-1, 2) - right.mean(axis=0))).sum()))
    return np.ascontiguousarray(best.reshape(-1, 2))


def board_points(columns: int, rows: int) -> Array:
    """The corners (rows * columns, 3) of a board in units of one square, row by row."""
    v, u = np.mgrid[0:rows, 0:columns]
    return np.column_stack([u.ravel(), v.ravel(), np.zeros(rows * columns)]).astype(float)
