"""Whether a lattice's dots lie on two surfaces: a laser's grid goes on smoothly over a blade, however that bends, and
jumps where the blade ends before something else, at a step of brightness."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.beside_kernels import shares_agreeing
from vision.capture import Image
from vision.evidence import beside
from vision.lattice import Lattice
from vision.lines import refine_lines

Array = NDArray[Any]  # of floats

LEAST_JUMP, SIGMAS = 0.03, 5.0  # of the spacing, and of its standard deviation
LEAST_DOTS = 8  # on either side
LEAST_SUPPORT = 0.6  # share of a line beside dots on which there is a step
REACH_PX, SLOPES_DEG, SAMPLES = 7, 2.0, 84
PASSES = 4  # of the robust fit


def on_two_surfaces(lines: Array, dots: Array, lattice: Lattice, smooth: Image, noise: float) -> bool:
    """Whether the dots (n, 2) of a lattice, image frame, jump at one of the lines (k, 2) of (theta, rho) that run
    between them."""
    normal, rho = np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])]), np.ascontiguousarray(lines[:, 1])
    before = (dots @ normal.T < rho).sum(axis=0)
    among = (before >= LEAST_DOTS) & (len(dots) - before >= LEAST_DOTS)
    if not among.any():
        return False
    found = refine_lines(
        smooth, normal[among], rho[among], noise, np.zeros(int(among.sum())), REACH_PX, SLOPES_DEG, SAMPLES
    )
    low, high = beside(dots, found.normal)
    support = shares_agreeing(found.t, found.agrees, low - 8, high + 8, 6)
    sides = dots @ found.normal.T < found.rho
    return any(_jumps(dots, lattice, sides[:, k]) for k in np.flatnonzero(support > LEAST_SUPPORT).tolist())


def _jumps(dots: Array, lattice: Lattice, inside: NDArray[np.bool_]) -> bool:
    """Whether dots (n, 2) on one side are all shifted alike against one curved surface through all of them."""
    if not LEAST_DOTS <= inside.sum() <= len(inside) - LEAST_DOTS:
        return False
    r, c = lattice.row - lattice.row.mean(), lattice.column - lattice.column.mean()
    design = np.column_stack([np.ones(len(r)), r, c, r * r, r * c, c * c, ~inside]).astype(float)
    weight = np.ones(len(r))
    for _ in range(PASSES):
        normal = design.T @ (design * weight[:, None]) + 1e-9 * np.eye(design.shape[1])
        fit = np.linalg.solve(normal, design.T @ (dots * weight[:, None]))
        residual = np.hypot(*(dots - design @ fit).T)
        scale = 1.4826 * float(np.median(residual)) + 1e-6
        weight = 1 / (1 + (residual / (2 * scale)) ** 2)
    steps = np.hypot(*fit[1:3].T)
    scale = max(scale, 1e-3 * float(steps.min()))
    sigma = scale * float(np.sqrt(np.linalg.inv(normal)[-1, -1]))
    return bool(float(np.hypot(*fit[-1])) > max(LEAST_JUMP * float(steps.min()), SIGMAS * sigma))
