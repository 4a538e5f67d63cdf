"""How the tracked blade changes as the view moves along it and as time passes: the Φ and Q of (6.1) and (6.2).

The blade stands still. Moving the reference point along it is exact but for curvatures that change on the way, as a
Gauss-Markov process along the blade (integrated twice: curvature, slope, place). What seems to move the whole blade
is the vehicle's own: its position drifts and trembles, and a camera whose angles are reported a little wrong sees the
blade shift as it travels.
"""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from vision.tracker_settings import TrackerSettings

Array = NDArray[np.float64]
Side = Literal["leading", "trailing"]

SIZE: Final = 20
DEPTH, DEPTH_SLOPE, ACROSS_SLOPE = 0, 1, 2
PLANE: Final = slice(0, 3)
SLOPES: Final = slice(1, 3)
EDGE: Final[dict[Side, slice]] = {"leading": slice(3, 5), "trailing": slice(5, 7)}
BLADE: Final = slice(0, 7)
DEPTH_CURVATURE, TWIST, ACROSS_CURVATURE = 7, 8, 11
EDGE_CURVATURE: Final[dict[Side, int]] = {"leading": 9, "trailing": 10}
TREMBLE: Final = slice(12, 15)
TURNED: Final = slice(15, 18)
RECESS: Final[dict[Side, int]] = {"leading": 18, "trailing": 19}
SIDES: Final[tuple[Side, Side]] = ("leading", "trailing")
SIGN: Final[dict[Side, float]] = {"leading": 1.0, "trailing": -1.0}
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_CHAINS = [
    (*np.ix_(rows, rows), rows[2])
    for rows in (
        (DEPTH, DEPTH_SLOPE, DEPTH_CURVATURE),
        *((EDGE[side].start, EDGE[side].start + 1, EDGE_CURVATURE[side]) for side in SIDES),
    )
]
_TWISTS = np.ix_((ACROSS_SLOPE, TWIST), (ACROSS_SLOPE, TWIST))
_CAMBER = np.ix_((DEPTH, ACROSS_SLOPE, ACROSS_CURVATURE), (DEPTH, ACROSS_SLOPE, ACROSS_CURVATURE))


def curvature_sigmas(station: float, settings: TrackerSettings) -> dict[int, float]:
    """Sigma (1/m) of each curvature of the state at a station."""
    pairs = {
        DEPTH_CURVATURE: settings.depth_curvature,
        TWIST: settings.twist,
        EDGE_CURVATURE["leading"]: settings.leading_curvature,
        EDGE_CURVATURE["trailing"]: settings.trailing_curvature,
        ACROSS_CURVATURE: settings.across_curvature,
    }
    return {value: between(station, pair, settings) for value, pair in pairs.items()}


def between(station: float, pair: tuple[float, float], settings: TrackerSettings) -> float:
    """What is `pair` near the root and farther out, at a station: by the same share from one metre to the next."""
    return float(np.exp(np.interp(station, settings.round_within_m, np.log(pair))))


def alike_m(station: float, settings: TrackerSettings) -> float:
    """Over how many metres of travel curvatures are like themselves at a station."""
    return float(np.interp(station, settings.round_within_m, settings.alike_m))


def alike_across_m(station: float, settings: TrackerSettings) -> float:
    """Over how many metres across the blade its curvature is like itself at a station."""
    return float(np.interp(station, settings.round_within_m, settings.alike_across_m))


def recess_sigma(station: float, settings: TrackerSettings) -> float:
    """Sigma (m) of how far behind the surface an edge lies."""
    return between(station, settings.recess_m, settings)


def led_to(travel: float, alike: float) -> tuple[float, float, float]:
    """What a curvature of one, like itself over so many metres, leads to after a travel (m, either way): place, slope,
    and what is left of itself."""
    length = abs(travel)
    slope = -alike * np.expm1(-length / alike)
    return float(alike * (length - slope)), float(np.copysign(slope, travel)), float(np.exp(-length / alike))


def travel(along: float, across: float, station: float, settings: TrackerSettings) -> Array:
    """Φ (20, 20) of a reference point that moves by `along` metres of station, to this one, and `across` metres of
    offset."""
    place, slope, left = led_to(along, alike_m(station, settings))
    bulge, lean, kept = led_to(across, alike_across_m(station, settings))
    shrunk = shrinking(along, station, settings)
    transition = np.eye(SIZE)
    transition[DEPTH, [DEPTH_SLOPE, ACROSS_SLOPE]] = along, across
    transition[DEPTH, [DEPTH_CURVATURE, TWIST, ACROSS_CURVATURE]] = place, slope * across, bulge
    transition[DEPTH_SLOPE, [DEPTH_CURVATURE, TWIST]] = slope, across
    transition[ACROSS_SLOPE, [TWIST, ACROSS_CURVATURE]] = slope, lean
    for side in SIDES:
        start, curvature = EDGE[side].start, EDGE_CURVATURE[side]
        transition[start, [start + 1, curvature]] = along, place
        transition[start + 1, curvature] = slope
        transition[RECESS[side], RECESS[side]] = left * shrunk[RECESS[side]]
    for curvature in (DEPTH_CURVATURE, TWIST, *EDGE_CURVATURE.values()):
        transition[curvature, curvature] = left * shrunk[curvature]
    transition[ACROSS_CURVATURE, ACROSS_CURVATURE] = left * kept * shrunk[ACROSS_CURVATURE]
    return transition


def shrinking(along: float, station: float, settings: TrackerSettings) -> dict[int, float]:
    """What is left of each curvature and recess on the way to a station because blades have less of it there: what
    bends a root says nothing of the bend farther out. Where they have more, noise alone adds it."""
    here, before = _sigmas(station, settings), _sigmas(station - along, settings)
    return {value: min(sigma / before[value], 1.0) for value, sigma in here.items()}


def _sigmas(station: float, settings: TrackerSettings) -> dict[int, float]:
    return curvature_sigmas(station, settings) | dict.fromkeys(RECESS.values(), recess_sigma(station, settings))


def carried(mean: Array, lens: Array) -> Array:
    """Φ (20, 20) of a lens that moves by (3,): a camera that is turned by r shows the blade shifted by lens × r."""
    s, n, d = lens
    transition = np.eye(SIZE)
    transition[BLADE, TURNED] = shifted(mean) @ np.array([[0.0, -d, n], [d, 0.0, -s], [-n, s, 0.0]])
    return transition


def travel_noise(along: float, across: float, station: float, settings: TrackerSettings) -> Array:
    """Q (20, 20) of moving the reference to a station: curvatures change, and with them what they lead to."""
    noise = np.zeros((SIZE, SIZE))
    chain = wandered(along, alike_m(station, settings))
    fresh = max(float(chain[2, 2]), 1e-12)
    here, before = _sigmas(station, settings), _sigmas(station - along, settings)
    # So much that each is as large here as blades have it, whatever it was before.
    added = {v: here[v] ** 2 - (1 - fresh) * min(here[v], before[v]) ** 2 for v in here}
    for rows, columns, curvature in _CHAINS:
        noise[rows, columns] += added[curvature] / fresh * chain
    noise[_TWISTS] += added[TWIST] / fresh * chain[1:, 1:]
    noise[_CAMBER] += here[ACROSS_CURVATURE] ** 2 * wandered(across, alike_across_m(station, settings))
    for value in (ACROSS_CURVATURE, *RECESS.values()):
        noise[value, value] += added[value]
    return noise


def wandered(travel: float, alike: float) -> Array:
    """Covariance (3, 3) of place, slope and curvature that a curvature of sigma one gathers on the way."""
    # Gauss's quadrature over the way: never indefinite, however short the way is.
    length = abs(travel) * (1 + _NODES) / 2
    slope = -alike * np.expm1(-length / alike)
    chain = np.stack([alike * (length - slope), np.copysign(slope, travel), np.exp(-length / alike)])
    gathered: Array = (chain * _WEIGHTS) @ chain.T * abs(travel) / alike
    return gathered


def shifted(mean: Array) -> Array:
    """(7, 3): how plane and edges change when the blade seems to shift by (station, offset, depth)."""
    shift = np.zeros((7, 3))
    shift[DEPTH] = -mean[DEPTH_SLOPE], -mean[ACROSS_SLOPE], 1.0
    for side in SIDES:
        start = EDGE[side].start
        shift[start] = -mean[start + 1], 1.0, 0.0
    return shift


def passing(seconds: float, settings: TrackerSettings) -> Array:
    """Φ (20, 20) of time: the trembling forgets itself."""
    transition = np.eye(SIZE)
    transition[TREMBLE, TREMBLE] *= np.exp(-max(seconds, 0.0) / settings.jitter_s)
    return transition


def passing_noise(mean: Array, seconds: float, jitter_m: float, settings: TrackerSettings) -> Array:
    """Q (20, 20) of time: the local position drifts and trembles, and the camera's angles wander."""
    seconds = max(seconds, 0.0)
    noise = np.zeros((SIZE, SIZE))
    shift = shifted(mean)
    noise[BLADE, BLADE] = settings.drift_m_per_root_s**2 * seconds * shift @ shift.T
    noise[TREMBLE, TREMBLE] = np.eye(3) * jitter_m**2 * -np.expm1(-2 * seconds / settings.jitter_s)
    noise[TURNED, TURNED] = np.eye(3) * settings.turned_per_root_s**2 * seconds
    return noise
