"""How much of the blade was photographed: the stretch of edge in one frame, the share of the span that frames cover."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vision.camera import Camera
    from vision.estimate import BladeEstimate

SHARP = 0.3
"""Sharpness (0 to 1) below which an inspector cannot use a frame."""

Interval = tuple[float, float]


def mm_per_px(distance_m: float, focal_px: float) -> float:
    """What one pixel of the full image spans on the surface, in millimetres."""
    return 1000.0 * distance_m / focal_px


def visible_stretch(estimate: BladeEstimate, side: str, camera: Camera) -> Interval | None:
    """Stations (m from the hub, lower and upper) between which the edge of `side` lies inside the image; None where it
    does not. The surface is taken as parallel to the image over the width of one frame."""
    edge = estimate.leading if side == "leading" else estimate.trailing
    if edge is None or edge.line is None:
        return None
    cos, sin = math.cos(edge.line.theta), math.sin(edge.line.theta)
    foot = (edge.line.rho * cos, edge.line.rho * sin)
    inside = _clipped(foot, (-sin, cos), ((camera.width - 1) / 2, (camera.height - 1) / 2))
    if inside is None:
        return None
    metres = estimate.distance_m / camera.fx
    toward_tip = (math.cos(estimate.heading), math.sin(estimate.heading))
    ends = [
        estimate.station_m + metres * ((foot[0] - s * sin) * toward_tip[0] + (foot[1] + s * cos) * toward_tip[1])
        for s in inside
    ]
    return min(ends), max(ends)


def _clipped(point: Interval, direction: Interval, half: Interval) -> Interval | None:
    """The range of s for which point + s direction lies within ± half."""
    low, high = -math.inf, math.inf
    for at, along, limit in zip(point, direction, half, strict=True):
        if abs(along) < 1e-12:
            if abs(at) > limit:
                return None
            continue
        first, second = sorted(((-limit - at) / along, (limit - at) / along))
        low, high = max(low, first), min(high, second)
    return (low, high) if low < high else None


def share(stretches: Iterable[Interval], root_m: float, tip_m: float) -> float:
    """Share of the span from root to tip that lies in any of the stretches."""
    covered, reached = 0.0, root_m
    for low, high in sorted(stretches):
        start, end = max(low, reached), min(high, tip_m)
        if end > start:
            covered += end - start
        reached = max(reached, min(high, tip_m))
    return covered / (tip_m - root_m) if tip_m > root_m else 0.0
