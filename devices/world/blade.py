"""The shape of one blade in its own coordinates: station along the span, offset to the leading side, depth to the
back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TipShape = Literal["round", "square", "spiked"]

# Share of the length → share of the way from the root's diameter to the largest chord, and from there to the tip's.
_INBOARD = ((0.0, 0.0), (0.03, 0.0), (0.10, 0.55), (0.20, 1.0))
_OUTBOARD = ((0.35, 0.26), (0.50, 0.47), (0.65, 0.65), (0.80, 0.82), (0.92, 0.935), (1.0, 1.0))
_THICKNESS = ((0.0, 1.0), (0.03, 1.0), (0.10, 0.62), (0.20, 0.36), (0.35, 0.26), (0.5, 0.21), (0.75, 0.18), (1.0, 0.16))
_AXIS = ((0.0, 0.5), (0.03, 0.5), (0.10, 0.40), (0.20, 0.32), (0.50, 0.30), (1.0, 0.30))
_TWIST_DEG = ((0.0, 13.0), (0.2, 11.0), (0.35, 7.5), (0.5, 4.5), (0.75, 1.5), (1.0, 0.0))
_CAMBER, _CAMBER_AT = 0.02, 0.4
_BACK_EDGE = 0.003  # thickness of the trailing edge as a share of the chord


def _curve(knots: tuple[tuple[float, float], ...], x: Array) -> Array:
    """A smooth curve through the knots that never overshoots them."""
    from scipy.interpolate import PchipInterpolator

    curve: Array = PchipInterpolator(*np.array(knots).T)(x)
    return curve


@dataclass(frozen=True)
class Blade:
    """A blade with a round root, an aerofoil from the largest chord on, twist, taper and a tip of its own shape.

    Stations are metres from the hub's centre; the blade runs from root_radius_m over length_m. pitch in radians turns
    the whole blade about its axis, leading edge to the front.
    """

    root_radius_m: float
    length_m: float
    root_diameter_m: float
    max_chord_m: float
    tip_chord_m: float
    pitch: float
    tip: TipShape = "round"

    @property
    def tip_radius_m(self) -> float:
        """Station of the outermost point."""
        return self.root_radius_m + self.length_m

    @cached_property
    def stations(self) -> Array:
        """Stations (n,) that the mesh is built on: 0.25 m apart, closer at the tip."""
        end = self.tip_radius_m
        cap = self._cap_m
        inner = np.arange(self.root_radius_m, end - cap, 0.25)
        outer = end - cap + cap * np.sin(np.linspace(0, np.pi / 2, 25))
        if self.tip == "spiked":
            outer = np.linspace(end - cap, end, 13)
        return np.concatenate([inner, outer])

    @property
    def _cap_m(self) -> float:
        """Length of the stretch over which the chord closes at the tip."""
        return {"round": 0.9 * self.tip_chord_m, "square": 0.25, "spiked": 1.2}[self.tip]

    def chord_m(self, stations: Array) -> Array:
        """Chord (n,) at stations (n,), the closing of the tip included."""
        stations = np.asarray(stations, float)
        grow, fall = self.max_chord_m - self.root_diameter_m, self.tip_chord_m - self.max_chord_m
        knots = tuple((x, self.root_diameter_m + share * grow) for x, share in _INBOARD)
        knots += tuple((x, self.max_chord_m + share * fall) for x, share in _OUTBOARD)
        chord = _curve(knots, (stations - self.root_radius_m) / self.length_m)
        beyond = np.clip((stations - (self.tip_radius_m - self._cap_m)) / self._cap_m, 0.0, 1.0)
        if self.tip == "round":
            chord = chord * np.sqrt(np.maximum(1 - beyond**2, 0.0))
        elif self.tip == "spiked":
            chord = chord * (1 - beyond)
        return np.maximum(chord, 2e-3)

    def sections(self, stations: Array, around: int = 56) -> Array:
        """Outlines (n, around + 1, 3) in (station, offset, depth) m: from the trailing edge over the back to the
        leading edge and over the front to the trailing edge again."""
        stations = np.asarray(stations, float)
        share = (stations - self.root_radius_m) / self.length_m
        chord, ratio, axis = self.chord_m(stations), _curve(_THICKNESS, share), _curve(_AXIS, share)
        twist = np.deg2rad(_curve(_TWIST_DEG, share)) + self.pitch
        turn = np.linspace(0, 2 * np.pi, around + 1)
        x = (1 + np.cos(turn)) / 2
        side = np.where(turn <= np.pi, 1.0, -1.0)
        foil = 5 * (0.2969 * np.sqrt(x) - 0.126 * x - 0.3516 * x**2 + 0.2843 * x**3 - 0.1036 * x**4)
        p = _CAMBER_AT
        camber = _CAMBER * np.where(x < p, (2 * p * x - x**2) / p**2, (1 - 2 * p + 2 * p * x - x**2) / (1 - p) ** 2)
        bend = np.clip((ratio - 0.36) / 0.64, 0, 1)[:, None]
        roundness = bend * bend * (3 - 2 * bend)
        profile = side * foil
        thick = ratio[:, None] * (roundness * 0.5 * np.sin(turn) + (1 - roundness) * profile)
        thick = thick + (1 - roundness) * (camber + side * x * _BACK_EDGE / 2)
        forward = (axis[:, None] - x) * chord[:, None]
        back = thick * chord[:, None]
        cos, sin = np.cos(twist)[:, None], np.sin(twist)[:, None]
        outline = np.empty((*forward.shape, 3))
        outline[..., 0] = stations[:, None]
        outline[..., 1] = forward * cos + back * sin
        outline[..., 2] = back * cos - forward * sin
        return outline

    def edges(self, stations: Array) -> tuple[Array, Array]:
        """Leading and trailing edge as seen from the front: points (n, 3) of greatest and of least offset."""
        outline = self.sections(stations, around=224)
        rows = np.arange(len(outline))
        return outline[rows, outline[..., 1].argmax(axis=1)], outline[rows, outline[..., 1].argmin(axis=1)]
