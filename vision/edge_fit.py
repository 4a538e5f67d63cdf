"""An edge fitted once more to its steps before an end; and how far it may be off, from how its steps scatter about it
and how long they err together."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera
from vision.candidates import Candidate

Array = NDArray[Any]  # of floats

OWN_BEND = 2e-5  # 1/px, standard deviation of half the bend of an edge before an end, besides what the lens bends
USUAL_PX = 0.2  # standard deviation of a step's place, against which that is weighed
LENS_PX = 60.0  # to each side, over which the lens's bend is told
FOCUS_PX = 160.0  # standard deviation of the weight about the place where a bending edge is to be right
BEND_HELD = 1e-4  # what an edge's bend is held to, 1/px
STEP_PX = 0.015  # standard deviation of a step's place that no scatter shows
RHO_PX, SLOPE = 0.006, 3e-5  # of a line at best: the camera's own
LONGEST = 12.0  # how many neighbouring steps at most err together
PARTS = 5  # of an edge, that are held against each other


def lens_bend(camera: Camera | None, point: Array, normal: Array) -> float:
    """Half the change of slope per px, 1/px, that the lens gives a straight edge through a point (2,) of the image
    frame, square to normal (2,)."""
    if camera is None or not any(camera.distortion):
        return 0.0
    direction = np.array([-normal[1], normal[0]])
    places = point + np.array([[-LENS_PX], [0.0], [LENS_PX]]) * direction + camera.centre
    rays = camera.rays(places)
    middle = camera.project((rays[:1] + rays[2:]) / 2)[0]
    return float((places[1] - middle) @ normal) / LENS_PX**2


def settled(edge: Candidate, alike: bool, half_bend: float = 0.0) -> Candidate:
    """The edge with the standard deviations of its offset at its focus and of its slope.

    alike: it was fitted to all its run alike, half its bend held to half_bend, else about its focus."""
    profile, k = edge.profile, edge.index
    t, focus = profile.t[k], float(profile.focus[k])
    use = profile.agrees[k] & (t >= edge.ends[0] - 1) & (t <= edge.ends[1] + 1)
    if use.sum() < 6:
        return edge
    x = t[use] - focus
    residual = profile.offset[k][use]
    weight = np.ones_like(x) if alike else np.exp(-0.5 * (x / FOCUS_PX) ** 2)
    terms = np.column_stack([np.ones_like(x), x, x * x])
    if alike:
        residual = residual + 0.5 * profile.bend[k] * x * x - half_bend * x * x
        held = np.diag([1e-6, 1e-6, (USUAL_PX / OWN_BEND) ** 2])
        residual = residual - terms @ np.linalg.solve(terms.T @ terms + held, terms.T @ residual)
    variance = float((residual**2 * weight).sum() / weight.sum()) + STEP_PX**2
    lag = float((residual[1:] * residual[:-1]).mean()) / variance
    together = float(np.clip((1 + lag) / max(1 - lag, 1e-3), 1.0, LONGEST))
    together = max(together, _wandering(residual, weight, variance))
    if alike:
        spread = np.linalg.inv(terms.T @ terms / (variance * together) + np.diag([1e-6, 1e-6, 1 / OWN_BEND**2]))
    else:
        held = np.diag([1e-6, 1e-6, 1.0 / BEND_HELD**2])
        inverse = np.linalg.inv((terms * weight[:, None]).T @ terms + held)
        spread = variance * together * inverse @ ((terms * (weight**2)[:, None]).T @ terms + held) @ inverse
    slope_sigma, rho_sigma = profile.slope_sigma.copy(), profile.rho_sigma.copy()
    slope_sigma[k] = np.hypot(np.sqrt(spread[1, 1]), SLOPE)
    rho_sigma[k] = np.hypot(np.sqrt(spread[0, 0]), RHO_PX)
    return replace(edge, profile=replace(profile, slope_sigma=slope_sigma, rho_sigma=rho_sigma))


def _wandering(residual: Array, weight: Array, variance: float) -> float:
    """How many steps err together by what parts of an edge err on the mean: one that follows something else for a
    while errs for longer than neighbours tell."""
    parts = zip(np.array_split(residual, PARTS), np.array_split(weight, PARTS), strict=True)
    sums = [(float((r * w).sum()) ** 2 / max(float((w**2).sum()), 1e-9)) for r, w in parts]
    return float(sum(sums)) / variance / (PARTS - 2)


def trimmed(edge: Candidate, toward: Array, station: float, camera: Camera | None = None) -> Candidate:
    """The edge fitted to its steps before a station along `toward` (2,), px: where an end no longer bends it; bent as
    the camera bends it."""
    profile, k = edge.profile, edge.index
    direction, t = profile.direction[k], profile.t[k]
    before = edge.rho * float(edge.outward @ toward) + t * float(direction @ toward) < station
    use = before & (t >= edge.ends[0] - 1) & (t <= edge.ends[1] + 1) & np.isfinite(profile.offset[k])
    if use.sum() < 10:
        return edge
    focus = float(np.clip(0.0, t[use].min(), t[use].max()))
    place = t - focus
    offset = profile.offset[k] + 0.5 * profile.bend[k] * (t - profile.focus[k]) ** 2
    half_bend = lens_bend(camera, edge.outward * edge.rho + direction * focus, edge.outward)
    offset = offset - half_bend * place**2
    fit = np.array([float(np.median(offset[use])), 0.0, 0.0])
    terms = np.column_stack([np.ones_like(place), place, place * place])
    held = np.diag([1e-4, 1e-4 / 0.05**2, (USUAL_PX / OWN_BEND) ** 2])
    for tolerance in (2.0, 1.2, 0.8, 0.8):
        weight = use / (1 + ((offset - terms @ fit) / tolerance) ** 2) ** 2
        information = (terms * weight[:, None]).T @ terms + held
        fit = np.linalg.solve(information, (terms * weight[:, None]).T @ offset)
    turn = float(np.arctan(fit[1]))
    normal = edge.outward * np.cos(turn) - direction * np.sin(turn)
    point = edge.outward * (edge.rho + fit[0]) + direction * focus
    rho = float(normal @ point)
    moved = replace(profile, normal=profile.normal.copy(), rho=profile.rho.copy(), focus=profile.focus.copy())
    moved.normal[k], moved.rho[k], moved.focus[k] = normal, rho, focus
    reach = (float(max(edge.ends[0], t[use].min())), float(min(edge.ends[1], t[use].max())))
    return replace(edge, outward=normal, rho=rho, profile=moved, ends=reach)
