"""An edge fitted once more to its steps before an end; and how far it may be off, from how its steps scatter about it
and how long they err together."""

from __future__ import annotations

from dataclasses import replace
from math import hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera
from vision.candidates import Candidate
from vision.edge_fit_kernels import certainty, parabola

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
# information about offset, slope and half the bend: what a fit about a focus and one of all alike start with, what is
# known besides the steps of the latter, and what a fit before an end starts with
HELD = np.array([1e-6, 1e-6, 1.0 / BEND_HELD**2])
ALIKE_FITTED = np.array([1e-6, 1e-6, (USUAL_PX / OWN_BEND) ** 2])
ALIKE_KNOWN = np.array([1e-6, 1e-6, 1 / OWN_BEND**2])
HELD_BEFORE_END = np.array([1e-4, 1e-4 / 0.05**2, (USUAL_PX / OWN_BEND) ** 2])
TOLERANCES = np.array([2.0, 1.2, 0.8, 0.8])  # px: how far from the curve steps lose weight, pass by pass


def lens_bend(camera: Camera | None, point: Array, normal: Array) -> float:
    """Half the change of slope per px, 1/px, that the lens gives a straight edge through a point (2,) of the image
    frame, square to normal (2,)."""
    if camera is None or not camera.bends:
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
    bend, fitted, known = 0.0, HELD, HELD
    if alike:
        bend, fitted, known = 0.5 * float(profile.bend[k]) - half_bend, ALIKE_FITTED, ALIKE_KNOWN
    residual = profile.offset[k][use]
    rho, slope = certainty(t[use] - focus, residual, alike, bend, fitted, known, FOCUS_PX, STEP_PX, LONGEST, PARTS)
    slope_sigma, rho_sigma = profile.slope_sigma.copy(), profile.rho_sigma.copy()
    slope_sigma[k], rho_sigma[k] = hypot(slope, SLOPE), hypot(rho, RHO_PX)
    return replace(edge, profile=replace(profile, slope_sigma=slope_sigma, rho_sigma=rho_sigma))


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
    shift, slope = parabola(place, offset, use, HELD_BEFORE_END, TOLERANCES)
    turn = float(np.arctan(slope))
    normal = edge.outward * np.cos(turn) - direction * np.sin(turn)
    point = edge.outward * (edge.rho + shift) + direction * focus
    rho = float(normal @ point)
    moved = replace(profile, normal=profile.normal.copy(), rho=profile.rho.copy(), focus=profile.focus.copy())
    moved.normal[k], moved.rho[k], moved.focus[k] = normal, rho, focus
    reach = (float(max(edge.ends[0], t[use].min())), float(min(edge.ends[1], t[use].max())))
    return replace(edge, outward=normal, rho=rho, profile=moved, ends=reach)
