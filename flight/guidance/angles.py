"""Directions on the circle. Raw angles are never compared: pi and -pi are the same way."""

from __future__ import annotations

from collections.abc import Iterable
from math import atan2, cos, pi, remainder, sin


def wrap(angle: float) -> float:
    """The same direction in (-π, π]."""
    wrapped = remainder(angle, 2 * pi)
    return pi if wrapped == -pi else wrapped


def difference(a: float, b: float) -> float:
    """The shortest turn from direction b to direction a, in (-π, π]."""
    return wrap(a - b)


def circular_mean(angles: Iterable[float]) -> float:
    """The direction of the sum of the unit vectors. Raises ValueError where they cancel, since no mean exists then."""
    angles = tuple(angles)
    y, x = sum(sin(a) for a in angles), sum(cos(a) for a in angles)
    if x * x + y * y < 1e-18:
        raise ValueError("directions that cancel have no mean")
    return atan2(y, x)


def nearer_direction(axis: float, toward: float) -> float:
    """Of the two directions of an axis (an angle modulo π), the one nearer to `toward`, in (-π, π]."""
    return wrap(axis if abs(difference(axis, toward)) <= pi / 2 else axis + pi)
