"""Inner loops that fit one edge to its steps once more: about its focus or before an end, by a parabola held down."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]
Flags = NDArray[np.bool_]


@compiled
def _inverse(m: Floats, inverse: Floats) -> None:
    """Inverse (3, 3) of a symmetric matrix, of which the lower triangle counts."""
    a, b, c, d, e, f = m[0, 0], m[1, 0], m[2, 0], m[1, 1], m[2, 1], m[2, 2]
    # Cholesky, for matrices whose entries are of very different sizes
    l0 = np.sqrt(a)
    l1, l2 = b / l0, c / l0
    l3 = np.sqrt(d - l1 * l1)
    l4 = (e - l2 * l1) / l3
    l5 = np.sqrt(f - l2 * l2 - l4 * l4)
    i0, i3, i5 = 1 / l0, 1 / l3, 1 / l5
    i1, i4 = -l1 * i0 * i3, -l4 * i3 * i5
    i2 = -(l2 * i0 + l4 * i1) * i5
    inverse[0, 0], inverse[1, 1], inverse[2, 2] = i0 * i0 + i1 * i1 + i2 * i2, i3 * i3 + i4 * i4, i5 * i5
    inverse[0, 1] = inverse[1, 0] = i1 * i3 + i2 * i4
    inverse[0, 2] = inverse[2, 0] = i2 * i5
    inverse[1, 2] = inverse[2, 1] = i4 * i5


@compiled
def _information(place: Floats, weight: Floats, power: int, held: Floats, matrix: Floats) -> None:
    """Write matrix (3, 3): sum of weights to a power times the products of 1, x, x², and held (3,) on its diagonal."""
    matrix[:] = 0.0
    for k in range(len(place)):
        x, w = place[k], weight[k]
        if power == 2:
            w *= w
        wx = w * x * x
        matrix[0, 0] += w
        matrix[1, 0] += w * x
        matrix[1, 1] += wx
        matrix[2, 1] += wx * x
        matrix[2, 2] += wx * x * x
    matrix[2, 0] = matrix[1, 1]
    matrix[0, 1], matrix[0, 2], matrix[1, 2] = matrix[1, 0], matrix[2, 0], matrix[2, 1]
    for i in range(3):
        matrix[i, i] += held[i]


@compiled
def certainty(
    place: Floats, residual: Floats, alike: bool, bend: float, fitted: Floats, known: Floats, focus_px: float,
    least_px: float, longest: float, parts: int,
) -> tuple[float, float]:  # fmt: skip
    """Standard deviations of offset and slope at place 0 of an edge whose steps lie at places (n,) and off its curve by
    residual (n,) px, from how they scatter and how long they err together, at most `longest` neighbours or as long as
    the means of so many parts of it err.

    alike: fitted to all alike, and the curve, `bend` more than what residuals are to be told from, is fitted once more;
    else weighted about place 0 over focus_px. fitted, known (3,): information about offset, slope and half the bend
    that this fit starts with, and that there is besides the steps. least_px: of a step's place, what no scatter shows.
    """
    count = len(place)
    weight, matrix, inverse, other = np.ones(count), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    rest = residual.copy()
    if alike:
        _information(place, weight, 1, fitted, matrix)
        _inverse(matrix, inverse)
        y0, y1, y2 = 0.0, 0.0, 0.0
        for k in range(count):
            x = place[k]
            rest[k] += bend * x * x
            y0 += rest[k]
            y1 += x * rest[k]
            y2 += x * x * rest[k]
        a = inverse[0, 0] * y0 + inverse[0, 1] * y1 + inverse[0, 2] * y2
        b = inverse[1, 0] * y0 + inverse[1, 1] * y1 + inverse[1, 2] * y2
        c = inverse[2, 0] * y0 + inverse[2, 1] * y1 + inverse[2, 2] * y2
        for k in range(count):
            rest[k] -= a + (b + c * place[k]) * place[k]
    else:
        for k in range(count):
            weight[k] = np.exp(-0.5 * (place[k] / focus_px) ** 2)
    squares, weights, lagged = 0.0, 0.0, 0.0
    for k in range(count):
        squares += weight[k] * rest[k] * rest[k]
        weights += weight[k]
        if k > 0:
            lagged += rest[k] * rest[k - 1]
    variance = squares / weights + least_px**2
    lag = lagged / (count - 1) / variance
    together = min(max((1 + lag) / max(1 - lag, 1e-3), 1.0), longest)
    # one that follows something else for a while errs for longer than neighbours tell
    wandering, begin = 0.0, 0
    for part in range(parts):
        end = begin + count // parts + (1 if part < count % parts else 0)
        erring, squared = 0.0, 0.0
        for k in range(begin, end):
            erring += rest[k] * weight[k]
            squared += weight[k] * weight[k]
        wandering += erring * erring / max(squared, 1e-9)
        begin = end
    together = max(together, wandering / variance / (parts - 2))
    if alike:
        _information(place, weight, 1, np.zeros(3), matrix)
        for i in range(3):
            for j in range(3):
                matrix[i, j] /= variance * together
            matrix[i, i] += known[i]
        _inverse(matrix, inverse)
        return np.sqrt(inverse[0, 0]), np.sqrt(inverse[1, 1])
    _information(place, weight, 1, known, matrix)
    _inverse(matrix, inverse)
    _information(place, weight, 2, known, other)
    found = np.zeros(2)
    for which in range(2):
        for i in range(3):
            for j in range(3):
                found[which] += inverse[which, i] * other[i, j] * inverse[j, which]
    return np.sqrt(variance * together * found[0]), np.sqrt(variance * together * found[1])


@compiled
def parabola(place: Floats, offset: Floats, use: Flags, held: Floats, tolerances: Floats) -> tuple[float, float]:
    """Offset and slope at place 0 of the parabola on which most of the offsets (n,) at places (n,) lie that are of use
    (n,). held (3,): information about offset, slope and half the bend; tolerances px: pass by pass, how far from the
    curve offsets lose weight."""
    ordered, count = np.empty(len(place)), 0
    for k in range(len(place)):
        if use[k]:
            at = count
            while at > 0 and ordered[at - 1] > offset[k]:
                ordered[at] = ordered[at - 1]
                at -= 1
            ordered[at] = offset[k]
            count += 1
    a, b, c = 0.5 * (ordered[(count - 1) // 2] + ordered[count // 2]), 0.0, 0.0
    weight, matrix, inverse = np.zeros(len(place)), np.empty((3, 3)), np.empty((3, 3))
    for tolerance in tolerances:
        y0, y1, y2 = 0.0, 0.0, 0.0
        for k in range(len(place)):
            weight[k] = 0.0
            if use[k]:
                x = place[k]
                off = (offset[k] - (a + (b + c * x) * x)) / tolerance
                weight[k] = 1.0 / (1.0 + off * off) ** 2
                y0 += weight[k] * offset[k]
                y1 += weight[k] * x * offset[k]
                y2 += weight[k] * x * x * offset[k]
        _information(place, weight, 1, held, matrix)
        _inverse(matrix, inverse)
        a = inverse[0, 0] * y0 + inverse[0, 1] * y1 + inverse[0, 2] * y2
        b = inverse[1, 0] * y0 + inverse[1, 1] * y1 + inverse[1, 2] * y2
        c = inverse[2, 0] * y0 + inverse[2, 1] * y1 + inverse[2, 2] * y2
    return a, b
