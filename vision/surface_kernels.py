"""Inner loops of the surface fit: the plane that most dots agree on, and robust least squares from there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Array = NDArray[Any]  # of floats

NEAR = 9  # dots that make a local plane, the middle one included
ITERATIONS = 6


@compiled
def solve(matrix: Array, right: Array) -> None:
    """Solve in place by Cholesky: right (n,) becomes the solution, the lower triangle of matrix (n, n) its factor."""
    count = len(right)
    for j in range(count):
        for i in range(j, count):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(max(total, 1e-300)) if i == j else total / matrix[j, j]
    for i in range(count):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


@compiled
def median(values: Array) -> float:
    """The median of a few values (n,)."""
    count = len(values)
    ordered = np.empty(count)
    for k in range(count):
        value, place = values[k], k
        while place > 0 and ordered[place - 1] > value:
            ordered[place] = ordered[place - 1]
            place -= 1
        ordered[place] = value
    result: float = 0.5 * (ordered[(count - 1) // 2] + ordered[count // 2])
    return result


@compiled
def consensus(terms: Array, values: Array, sigma: Array, steep: float, start: Array) -> None:
    """Write start (3,): the plane through some point and its neighbours on which most points lie; of two such planes
    that share few points, the nearer one if it has at least a third as many.

    terms (n, 6), of which 1, y, z count. steep: slope over inverse depth from which a plane rather joins what stands
    one behind the other, as a standard deviation."""
    count = len(terms)
    planes, agrees = np.empty((count, 3)), np.empty((count, count), np.bool_)
    _local_planes(terms, values, sigma, planes)
    _agreement(terms, values, sigma, planes, agrees)
    score, depth, size = np.zeros(count), np.zeros(count), np.zeros(count, np.int64)
    best = 0
    for n in range(count):
        for m in range(count):
            if agrees[n, m]:
                size[n] += 1
                depth[n] += values[m]
        depth[n] /= max(size[n], 1)
        lean = np.sqrt(planes[n, 1] ** 2 + planes[n, 2] ** 2) / max(planes[n, 0], 1e-6)
        score[n] = size[n] * np.exp(-0.5 * (lean / steep) ** 2)
        if score[n] > score[best]:
            best = n
    chosen, most = best, 0.0
    for n in range(count):
        if score[n] < max(6.0, score[best] / 3) or depth[n] <= 1.1 * depth[best] or score[n] <= most:
            continue
        shared = 0
        for m in range(count):
            shared += agrees[n, m] and agrees[best, m]
        if shared < 0.3 * size[n]:
            chosen, most = n, score[n]
    normal = np.zeros((3, 3))
    start[:] = 0.0
    for m in range(count):
        if agrees[chosen, m]:
            weight = 1 / sigma[m] ** 2
            for i in range(3):
                start[i] += weight * terms[m, i] * values[m]
                for j in range(3):
                    normal[i, j] += weight * terms[m, i] * terms[m, j]
    for i in range(3):
        normal[i, i] += 1e-9
    solve(normal, start)


@compiled
def _local_planes(terms: Array, values: Array, sigma: Array, planes: Array) -> None:
    """Write planes (n, 3): least squares through each point and its nearest neighbours. terms (n, 6) = 1, y, z, …"""
    count = len(terms)
    size = min(NEAR, count)
    near, distance = np.empty(size, np.int64), np.empty(size)
    normal = np.empty((3, 3))
    for n in range(count):
        filled = 0
        for m in range(count):
            away = (terms[m, 1] - terms[n, 1]) ** 2 + (terms[m, 2] - terms[n, 2]) ** 2
            if filled == size and away >= distance[size - 1]:
                continue
            at = min(filled, size - 1)
            while at > 0 and distance[at - 1] > away:
                distance[at], near[at] = distance[at - 1], near[at - 1]
                at -= 1
            distance[at], near[at] = away, m
            filled = min(filled + 1, size)
        normal[:] = 0.0
        planes[n] = 0.0
        for k in near:
            weight = 1 / sigma[k] ** 2
            for i in range(3):
                planes[n, i] += weight * terms[k, i] * values[k]
                for j in range(3):
                    normal[i, j] += weight * terms[k, i] * terms[k, j]
        loose = 1e-6 * (normal[0, 0] + normal[1, 1] + normal[2, 2])
        for i in range(3):
            normal[i, i] += loose
        solve(normal, planes[n])


@compiled
def _agreement(terms: Array, values: Array, sigma: Array, planes: Array, agrees: NDArray[np.bool_]) -> None:
    """Write agrees (n, n): whether point m lies on plane n, roughly."""
    for n in range(len(planes)):
        a, b, c = planes[n, 0], planes[n, 1], planes[n, 2]
        for m in range(len(terms)):
            away = abs(values[m] - a - b * terms[m, 1] - c * terms[m, 2])
            agrees[n, m] = away < 4 * sigma[m] + 0.02 * values[m]


@compiled
def robust(design: Array, values: Array, sigma: Array, held: Array, solution: Array, weight: Array) -> float:
    """Iteratively reweighted least squares with Cauchy's weights, from solution (k,) on, in place, of the first k of
    the terms design (n, 6); held (6,) is information toward zero. Written: weight (n,); returned: the cost, squares of
    at most five sigma."""
    count, unknowns = len(design), len(solution)
    normal, right = np.empty((unknowns, unknowns)), np.empty(unknowns)
    for step in range(ITERATIONS):
        loose = 2.5 * (4.0 if step == 0 else 1.5)
        normal[:] = 0.0
        right[:] = 0.0
        for n in range(count):
            residual = values[n]
            for i in range(unknowns):
                residual -= design[n, i] * solution[i]
            weight[n] = 1 / sigma[n] ** 2 / (1 + (residual / sigma[n] / loose) ** 2) ** 2
            for i in range(unknowns):
                scaled = weight[n] * design[n, i]
                right[i] += scaled * values[n]
                for j in range(i + 1):
                    normal[i, j] += scaled * design[n, j]
        for i in range(unknowns):
            normal[i, i] += held[i]
        solve(normal, right)
        for i in range(unknowns):  # a copied slice would take seconds to compile
            solution[i] = right[i]
    cost = 0.0
    for n in range(count):
        residual = values[n]
        for i in range(unknowns):
            residual -= design[n, i] * solution[i]
        cost += min(abs(residual) / sigma[n], 5.0) ** 2
    return cost


@compiled
def fit(
    rays: Array, inverse_depth: Array, sigma: Array, held_slope: float, spread: Array,
    limits: tuple[float, float, float], coefficients: Array, covariance: Array, inliers: NDArray[np.bool_],
) -> bool:  # fmt: skip
    """The surface through points at inverse depths (n,), known to sigma (n,), along rays (n, 3); whether it is bent.

    held_slope: of a blade's surface; spread (6,): of its terms, over the inverse depth; both as standard deviations.
    limits: relative change of inverse depth from the plane that most lie on, past which a point is elsewhere; share of
    its bend by which a bent surface is no parabola; sigma of what counts for nothing. Written: coefficients (6,) of
    inverse depth in terms of 1, y, z, y², yz, z², covariance (3, 3) of the first three, inliers (n,)."""
    largest_bend, bent_otherwise, nowhere = limits
    count, values, start = len(rays), inverse_depth, np.empty(3)
    terms, relief, weight, far = np.empty((count, 6)), np.empty(count), np.empty(count), np.empty(count, np.bool_)
    for n in range(count):
        y, z = rays[n, 1], rays[n, 2]
        terms[n, 0], terms[n, 1], terms[n, 2] = 1.0, y, z
        terms[n, 3], terms[n, 4], terms[n, 5] = y * y, y * z, z * z
        # A point may stand off its neighbours by a little relief of the surface, which no sensor noise explains.
        relief[n] = np.sqrt(sigma[n] ** 2 + (0.002 * values[n]) ** 2)
    # A plane through a few neighbours is rough: what counts is to be on the same surface, not within the noise.
    consensus(terms, values, relief, 2 * held_slope, start)
    near, reach, nearest = 0, np.inf, 0
    for n in range(count):
        off = values[n] - (start[0] + start[1] * terms[n, 1] + start[2] * terms[n, 2])
        far[n] = abs(off) > 4 * relief[n] + largest_bend * values[n]
        near += not far[n]
        relief[n] = nowhere if far[n] else relief[n]  # what stands elsewhere pulls at nothing
        if np.sqrt(terms[n, 3] + terms[n, 5]) < reach:
            reach, nearest = np.sqrt(terms[n, 3] + terms[n, 5]), n
    # The little information that a surface's slope and bend are as small as they usually are.
    held, middle = np.empty(6), median(values)
    for i in range(6):
        held[i] = 1 / (spread[i] * middle) ** 2
    for i in range(6):
        coefficients[i] = start[i] if i < 3 else 0.0
    flat_cost = robust(terms, values, relief, held, coefficients[:3], weight)
    known, bent, unmodelled = 3, False, 0.0
    if near >= 16:
        curved, curved_weight = np.zeros(6), np.empty(count)
        curved[0], curved[1], curved[2] = start[0], start[1], start[2]
        curved_cost = robust(terms, values, relief, held, curved, curved_weight)
        better = (flat_cost - curved_cost) / 3 / max(curved_cost / (near - 6), 1.0)
        # A bend that is not modelled shows at the optical axis; past the nearest dot a parabola is soon anywhere.
        bend = (terms[nearest] * (coefficients - curved)).sum()
        unmodelled = abs(bend) * min(max((better - 1) / 5, 0.0), 1.0)
        if better > 6 and reach < 0.08:
            unmodelled, known, bent, weight = bent_otherwise * abs(bend), 6, True, curved_weight
            for i in range(6):
                coefficients[i] = curved[i]
    information, inverse = np.zeros((known, known)), np.zeros((3, known))
    squares, inside = 0.0, 0
    for n in range(count):
        off = values[n]
        for i in range(known):
            off -= terms[n, i] * coefficients[i]
            for j in range(i + 1):
                information[i, j] += terms[n, i] * weight[n] * terms[n, j]
        off /= relief[n]
        inliers[n] = abs(off) < 5 and not far[n]
        squares += off * off if inliers[n] else 0.0
        inside += inliers[n]
    for i in range(known):
        information[i, i] += held[i]
    scale = max(1.0, squares / max(inside - known, 1))
    factor = np.empty((known, known))
    for i in range(3):
        for j in range(known * known):
            factor[j // known, j % known] = information[j // known, j % known]
        inverse[i, i] = 1.0
        solve(factor, inverse[i])
    covariance[:] = scale * inverse[:, :3]
    covariance[0, 0] += unmodelled**2
    return bent
