"""What the outline of a blade's silhouette is made of: straight stretches, of which two that face away from each other,
or the one that outweighs all others, are the blade's edges, and what closes it between them is its end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.silhouette import SPACING, Silhouette

Array = NDArray[Any]  # of floats

STRAIGHT_PX = 1.5  # from a line, within which nearly all of a straight stretch lies
NEARLY_ALL = 0.85
LEAST_RUN = 24.0  # px
LEAST_EDGE = 36.0  # px, of a stretch that is an edge
LARGEST_TAPER, LARGEST_AT_END = np.deg2rad(16), np.deg2rad(42)  # between two edges, and where an end joins them
LEAST_BEHIND = 0.5  # of an edge's length, of the part farther from the end that is taken for it
ALIKE = np.deg2rad(20)  # a stretch that runs like an edge within this is no end of the blade
OUTWEIGHS = 2.0  # times as long an edge is as any stretch across it, where no other edge tells which is which
ASKEW = np.deg2rad(40)  # from square to the axis, of a stretch that closes the blade
SQUARE = 0.35  # of the width: so much of it a straight end has at least
CLOSES = 0.6  # of the width that is seen to close at least, where a corner of the end is out of view


@dataclass(frozen=True)
class Run:
    """A straight stretch: points first to last of a chain, its outward normal (2,), middle (2,) px, ends along its way
    (normal turned by +90°) from the middle."""

    chain: int
    first: int
    last: int
    outward: Array
    middle: Array
    ends: tuple[float, float]

    @property
    def length(self) -> float:
        return self.ends[1] - self.ends[0]


@dataclass(frozen=True)
class End:
    """toward (2,): along the blade to its end; point (2,) px: the outermost; run: the stretch that closes it, None
    where it is round; shoulder: where the edges end, px along toward."""

    toward: Array
    point: Array
    run: Run | None
    shoulder: float


@dataclass(frozen=True)
class Shape:
    """The edges of a blade (one or two), its end where that is in view."""

    edges: tuple[Run, ...]
    end: End | None = None


def runs_of(silhouette: Silhouette) -> list[Run]:
    """All straight stretches of an outline."""
    found = []
    for index, chain in enumerate(silhouette.chains):
        for first, last in _longest(chain, 0, len(chain) - 1):
            middle, way, _ = _line(chain[first : last + 1])
            outward = np.array([way[1], -way[0]])
            along = (chain[[first, last]] - middle) @ way
            found.append(Run(index, first, last, outward, middle, (float(along.min()), float(along.max()))))
    return found


def shape_of(silhouette: Silhouette) -> Shape | None:
    """Edges and end of a silhouette; None where its outline does not tell the one from the other."""
    runs = runs_of(silhouette)
    sides = [run for run in runs if run.length >= LEAST_EDGE]
    pairs = [
        (one, two)
        for a, one in enumerate(sides)
        for two in sides[a + 1 :]
        if float(-one.outward @ two.outward) > np.cos(LARGEST_AT_END) and _width(one, two) > 0
    ]
    for one, two in sorted(pairs, key=_likely, reverse=True):
        end = _end(silhouette, runs, (one, two))
        if end is not None:
            return Shape((_behind(one, sides, end.toward), _behind(two, sides, end.toward)), end)
        if float(-one.outward @ two.outward) > np.cos(LARGEST_TAPER):
            return Shape((one, two))
    if not sides:
        return None
    longest = max(sides, key=lambda run: run.length)
    others = [run for run in runs if float(run.outward @ longest.outward) < np.cos(ALIKE)]
    if any(run.length * OUTWEIGHS > longest.length for run in others):
        return None
    return Shape((longest,))


def _likely(pair: tuple[Run, Run]) -> float:
    """How much speaks for a pair: long edges, and nearly parallel ones, as sides of a tip lean more than edges."""
    return (pair[0].length + pair[1].length) * float(-pair[0].outward @ pair[1].outward) ** 2


def _end(silhouette: Silhouette, runs: list[Run], edges: tuple[Run, Run]) -> End | None:
    """What closes a blade between a pair of edges, where that is in view."""
    axis = edges[0].outward - edges[1].outward
    axis = np.array([-axis[1], axis[0]]) / np.hypot(*axis)
    for toward in (axis, -axis):
        across = [
            run
            for run in runs
            if run not in edges
            and float(run.outward @ toward) > np.cos(ASKEW)
            and all(float((run.middle - edge.middle) @ toward) > 0 for edge in edges)
        ]
        longest = max(across, key=lambda run: run.length * float(run.outward @ toward) ** 4, default=None)
        wide = _width(*edges) if longest is None else _width_at(edges, longest.middle, toward)
        share = 0.0 if longest is None else longest.length / max(wide, 1e-6)
        linked = _linked(edges, toward)
        if not linked and share < CLOSES:
            continue
        shoulder = max(_last(edge, toward) for edge in edges)
        if longest is not None and share > SQUARE:
            return End(toward, longest.middle, longest, shoulder)
        chain = silhouette.chains[edges[0].chain]
        return End(toward, chain[int((chain @ toward).argmax())], None, shoulder)
    return None


def _behind(edge: Run, sides: list[Run], toward: Array) -> Run:
    """The edge farther from the end, where it goes on bent: there the end does not bend it."""
    alike = [
        run
        for run in sides
        if float(run.outward @ edge.outward) > np.cos(ALIKE)
        and float((run.middle - edge.middle) @ toward) < 0
        and run.length > LEAST_BEHIND * edge.length
    ]
    return min(alike, key=lambda run: float(run.middle @ toward), default=edge)


def _linked(edges: tuple[Run, Run], toward: Array) -> bool:
    """Whether one chain leads from the one edge to the other by way of `toward`."""
    one, two = sorted(edges, key=lambda run: run.first)
    return one.chain == two.chain and float(np.array([-one.outward[1], one.outward[0]]) @ toward) > 0


def _last(edge: Run, toward: Array) -> float:
    way = np.array([-edge.outward[1], edge.outward[0]])
    return max(float((edge.middle + end * way) @ toward) for end in edge.ends)


def _width(one: Run, two: Run) -> float:
    """How far apart two edges are, px; negative where they face each other."""
    return float((one.middle - two.middle) @ (one.outward - two.outward)) / float(
        np.hypot(*(one.outward - two.outward))
    )


def _width_at(edges: tuple[Run, Run], point: Array, toward: Array) -> float:
    """How far apart the lines of two edges are on a line through a point (2,) square to the axis."""
    across = np.array([-toward[1], toward[0]])
    places = [float((edge.middle - point) @ edge.outward) / float(across @ edge.outward) for edge in edges]
    return abs(places[0] - places[1])


def _longest(chain: Array, low: int, high: int) -> list[tuple[int, int]]:
    """First and last points of straight stretches between two points of a chain: the longest, then those beside it."""
    best, least = (0, -1), round(LEAST_RUN / SPACING)
    for first in range(low, high - least + 1):
        last = first + max(least, best[1] - best[0] + 1)
        while last <= high and _line(chain[first : last + 1])[2] < STRAIGHT_PX:
            best, last = (first, last), last + 1
    if best[1] < best[0]:
        return []
    return [*_longest(chain, low, best[0]), best, *_longest(chain, best[1], high)]


def _line(points: Array) -> tuple[Array, Array, float]:
    """Middle (2,), way (2,) from first to last, and how far nearly all of points (n, 2) lie from their line."""
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    angle = 0.5 * float(np.arctan2(2 * (x * y).sum(), (x * x).sum() - (y * y).sum()))
    way = np.array([np.cos(angle), np.sin(angle)])
    if float(way @ (points[-1] - points[0])) < 0:
        way = -way
    off = np.sort(np.abs(x * way[1] - y * way[0]))
    return middle, way, float(off[int(NEARLY_ALL * (len(off) - 1))])
