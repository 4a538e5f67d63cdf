"""A photograph's outline as an observation tells it: edges, tip and sharpness, in pixels of the full image."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.lines import sampled
from vision.observation import Edge, Line, Tip
from vision.quality import SHARPEST
from vision.silhouette import Side, Silhouette

Array = NDArray[Any]  # of floats


def edge_of(side: Side, factor: float) -> Edge:
    """The piece of outline as an edge in pixels of the full image."""
    normal = side.outward if side.rho >= 0 else -side.outward
    ends = np.array(side.ends)[:, None] * side.direction + side.outward * side.rho
    return Edge(
        Line(float(np.arctan2(normal[1], normal[0])), abs(side.rho) * factor),
        side.outward.copy(),
        float(np.hypot(side.profile.slope_sigma[side.index], 0.0005)),
        float(side.profile.rho_sigma[side.index] * factor),
        side.share,
        ends * factor,
    )


def tip_of(outline: Silhouette, dots: Array, factor: float) -> Tip | None:
    """The tip in pixels of the full image: the line that closes the blade, and where the axis meets it."""
    tip = outline.tip
    if tip is None:
        return None
    axis = np.array([np.cos(outline.axis), np.sin(outline.axis)])
    toward = axis if float(tip.outward @ axis) > 0 else -axis
    across = np.array([-toward[1], toward[0]])
    corners = [_crossing(edge, tip) for edge in outline.edges]
    middle = float(np.mean([corner @ across for corner in corners])) if len(corners) == 2 else None
    if middle is None:
        middle = float((dots @ across).min() + (dots @ across).max()) / 2
    start = across * middle
    point = start + toward * (tip.rho - float(start @ tip.outward)) / float(toward @ tip.outward)
    normal = tip.outward if tip.rho >= 0 else -tip.outward
    line = Line(float(np.arctan2(normal[1], normal[0])), abs(tip.rho) * factor)
    return Tip(line, point * factor, float(tip.profile.rho_sigma[tip.index] + 1.0) * factor)


def _crossing(one: Side, two: Side) -> Array:
    return np.asarray(np.linalg.solve(np.stack([one.outward, two.outward]), np.array([one.rho, two.rho])), float)


def sharpness_of(tones: Image, edges: tuple[Side, ...]) -> float:
    """0 (blurred) to 1: how steep the edges are against their height. 0 without an edge to judge by."""
    height, width = tones.shape[:2]
    centre = (np.array([width, height]) - 1) / 2
    across = np.arange(-7.0, 8.0)
    best = 0.0
    for edge in edges:
        profile, k = edge.profile, edge.index
        good = profile.agrees[k]
        if good.sum() < 8:
            continue
        points = edge.outward * edge.rho + profile.t[k][good, None] * edge.direction + centre
        points = points + profile.offset[k][good, None] * edge.outward
        uv = points[:, None] + across[:, None] * edge.outward
        values = sampled(tones, uv[..., 0], uv[..., 1]).mean(axis=0)
        rise = np.abs(values[-4:].mean(axis=0) - values[:4].mean(axis=0))
        tone = int(rise.argmax())
        if rise[tone] > 2:
            best = max(best, float(np.abs(np.diff(values[:, tone])).max() / rise[tone]))
    return min(best / SHARPEST, 1.0)
