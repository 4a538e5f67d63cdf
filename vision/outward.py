"""Where whoever walks outward from a blade's dots first meets a step of brightness, and the lines that such places
form."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.lines import sampled

Array = NDArray[Any]  # of floats

RAYS = 48  # directions in which the outline is looked for from each outer dot
BOX = 3  # px averaged on either side of a step
LEAST_VOTES = 6.0
VOTE_PX = 3.0


def texture_between(smooth: Image, dots: Array, spacing: float) -> float:
    """How strong steps between neighbouring dots are, by rule: the blade's dirt and shade."""
    centre = (np.array(smooth.shape[1::-1]) - 1) / 2
    apart = np.hypot(*(dots[:, None] - dots[None]).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu((apart > 0.6 * spacing) & (apart < 1.35 * spacing), 1))
    if len(first) == 0:
        return 0.0
    share = np.linspace(0, 1, max(12, round(spacing)))
    points = dots[first, None] * (1 - share)[:, None] + dots[second, None] * share[:, None] + centre
    change = change_along(sampled(smooth, points[..., 0], points[..., 1]))
    return float(np.quantile(change.max(axis=1), 0.75))


def change_along(values: Array) -> Array:
    """Change (…, n) between the means of BOX samples before and after each of n along the last but one axis of values
    (…, n, c), of the tone that changes most; 0 at both ends."""
    sums = np.cumsum(np.concatenate([np.zeros_like(values[..., :1, :]), values], axis=-2), axis=-2)
    mean = (sums[..., BOX:, :] - sums[..., :-BOX, :]) / BOX
    change = np.abs(mean[..., BOX + 1 :, :] - mean[..., : -BOX - 1, :]).max(axis=-1)
    result: Array = np.zeros(values.shape[:-1])
    result[..., BOX : BOX + change.shape[-1]] = change
    return result


def first_steps(smooth: Image, outer: Array, level: float) -> Array:
    """Where rays from dots first meet a step of at least so much, (n, 2), image frame."""
    height, width = smooth.shape[:2]
    centre = (np.array([width, height]) - 1) / 2
    turn = np.arange(RAYS) * 2 * np.pi / RAYS
    way = np.column_stack([np.cos(turn), np.sin(turn)])
    reach = np.arange(4.0, 0.75 * max(width, height))
    points = outer[:, None, None] + reach[:, None] * way[:, None]
    uv = (points + centre).reshape(len(outer) * RAYS, len(reach), 2)
    change = change_along(sampled(smooth, uv[..., 0], uv[..., 1]))
    change[(uv < 3).any(axis=2) | (uv > 2 * centre - 3).any(axis=2)] = 0
    over = change > level
    hit = over.any(axis=1)
    first = over.argmax(axis=1)
    ahead = np.minimum(first[:, None] + np.arange(2 * BOX + 2), change.shape[1] - 1)
    peak = np.take_along_axis(ahead, np.take_along_axis(change, ahead, 1).argmax(axis=1)[:, None], 1)[:, 0]
    return np.asarray(uv[np.arange(len(uv)), peak][hit] - centre, float)


def lines_through(points: Array, dots: Array, strays: float, most: int = 24) -> Array:
    """Lines (k, 3) of unit normal and offset on which most of the points lie, with the dots on one side."""
    if len(points) < 8:
        return np.zeros((0, 3))
    theta = np.deg2rad(np.arange(0, 180, 1.5))
    normal = np.column_stack([np.cos(theta), np.sin(theta)])
    rho = points @ normal.T
    bins = np.rint(rho / VOTE_PX).astype(np.int64)
    low = int(bins.min())
    size = int(bins.max()) - low + 1
    votes = np.zeros((len(theta), size))
    across = dots @ normal.T
    inner, outer = np.quantile(across, strays / 2, axis=0), np.quantile(across, 1 - strays / 2, axis=0)
    for k in range(len(theta)):
        votes[k] = np.bincount(bins[:, k] - low, minlength=size)
        places = VOTE_PX * (np.arange(size) + low)
        votes[k, (places > inner[k] - 2) & (places < outer[k] + 2)] = 0
    smooth = votes + 0.5 * (np.pad(votes, ((0, 0), (1, 0)))[:, :-1] + np.pad(votes, ((0, 0), (0, 1)))[:, 1:])
    found = []
    for _ in range(most):
        k, r = (int(place) for place in np.unravel_index(int(smooth.argmax()), smooth.shape))
        if smooth[k, r] < LEAST_VOTES:
            break
        found.append((*normal[k], VOTE_PX * (r + low)))
        for turn in range(-3, 4):
            j, sign = (k + turn) % len(theta), 1 if 0 <= k + turn < len(theta) else -1
            at = (r + low) * sign - low
            smooth[j, max(at - 3, 0) : max(at + 4, 0)] = 0
    return np.array(found).reshape(-1, 3)
