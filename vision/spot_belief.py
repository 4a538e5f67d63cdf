"""Inner loops over fitted spots: the shape that most of them have, and which of them are believed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]


@compiled
def typical_shape(shapes: Floats, typical: Floats) -> None:
    """Write the shape (3,) whose inverse has the medians of what the inverses of shapes (n, 3) have."""
    ordered = np.empty(len(shapes))
    inverse = np.empty(3)
    for axis in range(3):
        for n in range(len(shapes)):
            determinant = shapes[n, 0] * shapes[n, 2] - shapes[n, 1] ** 2
            value, place = shapes[n, axis] / determinant, n
            while place > 0 and ordered[place - 1] > value:
                ordered[place] = ordered[place - 1]
                place -= 1
            ordered[place] = value
        inverse[axis] = 0.5 * (ordered[(len(shapes) - 1) // 2] + ordered[len(shapes) // 2])
    determinant = inverse[0] * inverse[2] - inverse[1] ** 2
    for axis in range(3):
        typical[axis] = inverse[axis] / determinant


@compiled
def believed(
    peaks: NDArray[np.int64], found: Floats, quality: Floats, pixels: int, bound_px: float, lone: float,
    significant: float, worst_px: float, apart_px: float, uv: Floats, sigma: Floats,
) -> NDArray[np.bool_]:  # fmt: skip
    """Which of n fits are spots: found (n, 4) and quality (n, 4) as of `fit_spots` on so many pixels each, about peaks
    (n, 2), the strongest first.

    A spot's level stands out `significant` times, its place is known to worst_px and within bound_px of the peak, and
    no spot before it lies nearer than apart_px. lone: how much more uncertain all is than claimed. Written: uv (n, 2),
    sigma (n,) of the place."""
    keep = np.empty(len(peaks), np.bool_)
    weight = pixels / 3
    for n in range(len(peaks)):
        # the fit's own residuals say how much of the claimed noise is true, as far as so few can
        scale = lone * np.sqrt((20 + weight * quality[n, 3]) / (20 + weight))
        sigma[n] = np.sqrt(0.5 * (quality[n, 0] + quality[n, 1])) * scale
        keep[n] = found[n, 2] > significant * np.sqrt(quality[n, 2]) * scale and sigma[n] < worst_px
        keep[n] &= abs(found[n, 0]) < bound_px and abs(found[n, 1]) < bound_px
        uv[n, 0], uv[n, 1] = peaks[n, 0] + found[n, 0], peaks[n, 1] + found[n, 1]
        for m in range(n):
            if keep[m] and (uv[n, 0] - uv[m, 0]) ** 2 + (uv[n, 1] - uv[m, 1]) ** 2 < apart_px**2:
                keep[n] = False
                break
    return keep
