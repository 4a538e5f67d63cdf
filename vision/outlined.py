"""Edges and end as a blade's silhouette tells them, held against what steps and dots tell."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import LEAST_SUPPORT, Candidate
from vision.capture import Image
from vision.edge_fit import settled, trimmed
from vision.edges import Found
from vision.ending import Ending
from vision.evidence import typical_step
from vision.lines import refine_lines
from vision.outline import ASKEW, End, Run, shape_of
from vision.silhouette import Silhouette

Array = NDArray[Any]  # of floats

SAME_ANGLE, SAME_PX = np.deg2rad(4.0), 4.0  # within which an edge and a straight stretch are one
NEARLY_SAME = np.deg2rad(10.0)  # the same where an edge follows more of an outline that bends
REACH_PX, SLOPES_DEG = 5, 1.5  # within which a stretch is fitted once more to its steps
ROUND_PX, STRAIGHT_PX = 2.0, 0.5  # standard deviation of an end that is round, and of one that is straight
UNTOLD = "no edge: the outline does not tell which part of it is an edge and which the end"
ELSEWHERE = "no edge: the likeliest ones do not lie on the outline"


def with_outline(found: Found, silhouette: Silhouette, smooth: Image, noise: float) -> Found:
    """What was found, with the edges and the end that the silhouette has where they differ; nothing where that does
    not tell edges from end, or has others than were found and none itself."""
    half = (np.array(smooth.shape[1::-1]) - 1) / 2
    for edge in found.edges:  # past which the region runs out into what is behind the blade and as bright
        silhouette = silhouette.within(edge.outward, edge.rho)
    shape = shape_of(silhouette)
    if shape is None:
        on_it = all(_followed(edge, silhouette, half) > 0.5 for edge in found.edges)
        return Found((), found.axis, None, (UNTOLD if on_it else ELSEWHERE,))
    bent = NEARLY_SAME if shape.end is None else 0.0
    known = [_same(run, found.edges, silhouette, half, bent) for run in shape.edges]
    chosen = tuple(edge or _fitted(run, smooth, noise, half) for edge, run in zip(known, shape.edges, strict=True))
    if min(edge.support for edge in chosen) < LEAST_SUPPORT:
        return found
    if len(shape.edges) == 1 and len(found.edges) == 2 and all(known):
        return found
    turns = np.array([np.arctan2(edge.outward[1], edge.outward[0]) + np.pi / 2 for edge in chosen])
    axis = float(0.5 * np.angle(np.exp(2j * turns).sum()) % np.pi)
    ending = found.ending if all(known) and _agrees(found.ending, shape.end, silhouette, half) else None
    return Found(chosen, axis, ending or _ending(shape.end, smooth, noise, half), ())


def _same(run: Run, edges: tuple[Candidate, ...], silhouette: Silhouette, half: Array, bent: float) -> Candidate | None:
    """The edge that is the same as a straight stretch, or that follows more of the outline and is turned less than
    `bent` (rad) from it."""
    for edge in edges:
        turn = float(edge.outward @ run.outward)
        if turn > np.cos(SAME_ANGLE) and abs(float((run.middle - half) @ edge.outward) - edge.rho) < SAME_PX:
            return edge
        if (
            turn > np.cos(NEARLY_SAME)
            and _followed(edge, silhouette, half) * (edge.ends[1] - edge.ends[0]) > run.length
        ):
            return edge
    return None


def _fitted(run: Run, smooth: Image, noise: float, half: Array) -> Candidate:
    """A straight stretch as an edge, fitted to its steps."""
    middle = run.middle - half
    rho, focus = float(middle @ run.outward), float(middle @ np.array([-run.outward[1], run.outward[0]]))
    profile = refine_lines(
        smooth, run.outward[None], np.array([rho]), noise, np.array([focus]), REACH_PX, SLOPES_DEG, 84
    )  # fmt: skip
    ends = (focus + run.ends[0], focus + run.ends[1])
    on_run = (profile.t >= ends[0] - 1) & (profile.t <= ends[1] + 1)
    support = float(profile.agrees[on_run].mean()) if on_run.any() else 0.0
    step = float(typical_step(profile, on_run)[0])
    edge = Candidate(
        profile.normal[0], float(profile.rho[0]), support, float("nan"), step, 0.0, 0.0, 0, ends, support, 0.0,
        profile, 0,
    )  # fmt: skip
    return settled(trimmed(edge, profile.direction[0], np.inf), True)


def _followed(edge: Candidate, silhouette: Silhouette, half: Array) -> float:
    """On what share of its stretch an edge lies on the outline."""
    places = edge.outward * edge.rho + np.linspace(*edge.ends, 25)[:, None] * edge.profile.direction[edge.index]
    return float((_apart(places, silhouette, half) < SAME_PX).mean())


def _apart(points: Array, silhouette: Silhouette, half: Array) -> Array:
    """How far points (n, 2) of the image frame are from the outline, (n,) px."""
    outline = np.vstack(silhouette.chains) - half
    apart = np.hypot(*(points.reshape(-1, 1, 2) - outline).transpose(2, 0, 1))
    return np.asarray(apart.min(axis=1, initial=np.inf))


def _ending(end: End | None, smooth: Image, noise: float, half: Array) -> Ending | None:
    if end is None:
        return None
    point, normal = end.point - half, end.toward
    sigma = ROUND_PX
    if end.run is not None:
        line = _fitted(end.run, smooth, noise, half)
        normal, sigma = line.outward, float(line.profile.rho_sigma[0]) + STRAIGHT_PX
        point = point + (line.rho - float(point @ normal)) * normal
    across = np.array([-normal[1], normal[0]])
    shoulder = end.shoulder - float(half @ end.toward)
    return Ending(normal, float(point @ normal), float(point @ across), shoulder, 1.0, sigma, np.inf, -np.inf)


def _agrees(ending: Ending | None, end: End | None, silhouette: Silhouette, half: Array) -> bool:
    """Whether the end that was found lies on the outline where that is closed."""
    if ending is None or end is None or float(ending.toward @ end.toward) < np.cos(ASKEW):
        return False
    across = np.array([-ending.toward[1], ending.toward[0]])
    point = ending.station * ending.toward + ending.lane * across
    return bool(_apart(point, silhouette, half)[0] < SAME_PX)
