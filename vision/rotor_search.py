"""First guesses of a rotor in a picture, from straight edges alone.

Two lines that close slowly may be the edges of a blade, and its axis then runs through the point where they meet. Two
such blades, 120° apart, around the crossing of their axes may be a rotor; whether they are, and how they are pitched,
the whole model has to tell.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.rotor_model import HUB, PITCH, RADIUS, SHAPE, SIZE, TILT, TURN, USUAL_TILT, YAW

Array = NDArray[np.float64]

ANGLES = 180  # bins of the accumulator, modulo 180°
RHO_STEP = 2.0
MOST_LINES = 120
SPACING = np.deg2rad(12.0)  # how far from 120° perspective may bring two blades
CLOSING = np.deg2rad(0.5), np.deg2rad(15.0)  # by which angle the edges of a blade approach each other
AXIS_SHARE = 0.38  # of a blade's width lies before its axis: less in the rotor's plane, half of it where feathered
LENGTH = 0.15, 3.0  # of the image's diagonal, from the hub to where the edges would meet
WIDTH = 0.005, 0.25  # of the image's diagonal, of a blade whose edges are prolonged to the hub
ALIKE = 2.8  # by which factor widths and lengths of two blades may differ as they are seen
RADII = 0.15, 2.5  # of the image's diagonal: the rotor's
MOST_TRIED = 1200
YAWS = np.deg2rad([-15.0, 15.0])
SIZES = np.array([0.75, 1.0, 1.4])
PITCHES = np.deg2rad([5.0, 40.0, 65.0, 85.0])
ROOTWARD = 1.4  # the edges prolonged to the hub are so much wider than the largest chord
OUTER_TWIST, OUTER_THICKNESS = np.deg2rad(5.0), 0.25
THIRD = 2 * np.pi / 3


def strongest_lines(planes: NDArray[np.float32], most: int = MOST_LINES) -> tuple[Array, Array]:
    """The (θ, ρ) (k, 2) of straight edges, ρ signed, and votes (k,). planes (h, w, c): float32 picture channels."""
    height, width = planes.shape[:2]
    dx, dy = (
        cv2.Sobel(planes, cv2.CV_32F, *order, scale=0.25).reshape(height, width, -1) for order in ((1, 0), (0, 1))
    )
    strongest = np.argmax(np.abs(dx) + np.abs(dy), axis=2)[..., None]
    gx, gy = (np.take_along_axis(g, strongest, 2)[..., 0] for g in (dx, dy))
    size = np.hypot(gx, gy)
    size[:3], size[-3:], size[:, :3], size[:, -3:] = 0, 0, 0, 0
    threshold = max(1.5, 1.2 * float(np.quantile(size[::3, ::3], 0.6)))
    v, u = np.nonzero(size > threshold)
    weight = np.minimum(size[v, u] / (2 * threshold), 1.0)
    angle = np.arctan2(gy[v, u], gx[v, u]) % np.pi
    step_u, step_v = np.rint(np.cos(angle)).astype(np.int64), np.rint(np.sin(angle)).astype(np.int64)
    crest = (size[v, u] >= size[v + step_v, u + step_u]) & (size[v, u] > size[v - step_v, u - step_u])
    v, u, weight, angle = v[crest], u[crest], weight[crest], angle[crest]
    x, y = u - (width - 1) / 2, v - (height - 1) / 2
    reach = np.hypot(width, height) / 2
    bins = int(2 * reach / RHO_STEP) + 3
    own = np.floor(angle / np.pi * ANGLES).astype(np.int64)
    theta = (np.arange(ANGLES) + 0.5) * np.pi / ANGLES
    votes = np.zeros(ANGLES * bins)
    for step in range(-3, 4):
        at = (own + step) % ANGLES
        place = np.rint((x * np.cos(theta[at]) + y * np.sin(theta[at]) + reach) / RHO_STEP).astype(np.int64) + 1
        votes += np.bincount(at * bins + place, weight, votes.size)
    table = cv2.blur(votes.reshape(ANGLES, bins).astype(np.float32), (3, 1))
    wrapped = np.vstack([table[-3:, ::-1], table, table[:3, ::-1]])
    highest = cv2.dilate(wrapped, np.ones((7, 5), np.uint8))
    a, r = np.nonzero((wrapped == highest)[3:-3] & (table > 0.03 * min(width, height)))
    order = np.argsort(-table[a, r], kind="stable")[:most]
    lines = np.column_stack([theta[a[order]], (r[order] - 1) * RHO_STEP - reach])
    return lines, table[a[order], r[order]].astype(float)


@dataclass(frozen=True)
class _Blades:
    """Pairs of lines that two edges of one blade could be: directions (n,), signed distance (n,) of the axis from the
    image's centre along its clockwise normal, apex (n, 2) where the edges meet, closing angle (n,), votes (n,)."""

    direction: Array
    offset: Array
    apex: Array
    closing: Array
    votes: Array


def _blades(lines: Array, votes: Array) -> _Blades:
    direction = np.concatenate([lines[:, 0] - np.pi / 2, lines[:, 0] + np.pi / 2]) % (2 * np.pi)
    rho = np.concatenate([lines[:, 1], -lines[:, 1]])
    strength = np.minimum(np.concatenate([votes, votes]), 120)
    lean = _wrapped(direction[None, :] - direction[:, None])
    one, other = np.nonzero((lean > CLOSING[0]) & (lean < CLOSING[1]))
    closing = lean[one, other]
    matrix = np.stack([np.stack([-np.sin(direction[k]), np.cos(direction[k])], axis=-1) for k in (one, other)], axis=1)
    apex = np.linalg.solve(matrix, np.stack([rho[one], rho[other]], axis=-1)[..., None])[..., 0]
    axis = direction[one] + AXIS_SHARE * closing
    offset = apex[:, 1] * np.cos(axis) - apex[:, 0] * np.sin(axis)
    return _Blades(axis % (2 * np.pi), offset, apex, closing, strength[one] + strength[other])


def guesses(planes: NDArray[np.float32], near: Array | None, within_px: float) -> Array:
    """First guesses (k, 12) of the rotor (`vision.rotor_model`), those with the most votes first. near (2,): where the
    hub is expected in the image frame, within so much.

    How wide a blade looks depends on its pitch, so each pair of blades yields a guess for several pitches.
    """
    height, width = planes.shape[:2]
    diagonal = float(np.hypot(width, height))
    lines, votes = strongest_lines(planes)
    blades = _blades(lines, votes)
    gap = (blades.direction[None, :] - blades.direction[:, None]) % (2 * np.pi)
    one, other = np.nonzero(np.abs(gap - THIRD) < SPACING)
    d1, d2 = blades.direction[one], blades.direction[other]
    o1, o2 = blades.offset[one], blades.offset[other]
    # The axes v·p = o with v = (-sin d, cos d) cross at the hub.
    hub = np.stack([o1 * np.cos(d2) - o2 * np.cos(d1), o1 * np.sin(d2) - o2 * np.sin(d1)], axis=-1)
    hub /= np.sin(d2 - d1)[:, None]
    good = np.all(np.abs(hub) < 0.95 * np.array([width, height]) / 2, axis=1)
    if near is not None:
        good &= np.linalg.norm(hub - near, axis=1) < within_px
    one, other, hub, d1, d2 = one[good], other[good], hub[good], d1[good], d2[good]
    ends = [blades.apex[k] - hub for k in (one, other)]
    lengths = np.stack([end[:, 0] * np.cos(d) + end[:, 1] * np.sin(d) for end, d in zip(ends, (d1, d2), strict=True)])
    widths = lengths * np.tan(np.stack([blades.closing[one], blades.closing[other]]))
    good = np.all((lengths > LENGTH[0] * diagonal) & (lengths < LENGTH[1] * diagonal), axis=0)
    good &= np.all((widths > WIDTH[0] * diagonal) & (widths < WIDTH[1] * diagonal), axis=0)
    good &= np.abs(np.log(np.maximum(widths[0], 1) / np.maximum(widths[1], 1))) < np.log(ALIKE)
    good &= np.abs(np.log(np.maximum(lengths[0], 1) / np.maximum(lengths[1], 1))) < np.log(ALIKE)
    best = np.flatnonzero(good)
    best = best[np.argsort(-(blades.votes[one] + blades.votes[other])[best], kind="stable")[:MOST_TRIED]]
    turn = (d1 + _wrapped(d2 - d1 - THIRD) / 2)[best]
    wide = np.sqrt(widths[:, best].prod(axis=0))
    found = np.zeros((len(best), len(YAWS), len(SIZES), len(PITCHES), SIZE))
    found[..., HUB] = hub[best, None, None, None]
    found[..., TURN] = turn[:, None, None, None]
    found[..., YAW] = YAWS[:, None, None]
    found[..., TILT] = USUAL_TILT
    found[..., PITCH] = PITCHES
    found[..., RADIUS] = np.log(
        SIZES[:, None] * wide[:, None, None, None] / (ROOTWARD * SHAPE[1] * _seen_width(PITCHES))
    )
    every = found.reshape(-1, SIZE)
    size = every[:, RADIUS] - np.log(diagonal)
    result: Array = every[(size > np.log(RADII[0])) & (size < np.log(RADII[1]))]
    return result


def _seen_width(pitch: Array) -> Array:
    """Of a blade from the front, in chords: what its chord and its thickness hide."""
    result: Array = np.hypot(np.cos(pitch + OUTER_TWIST), OUTER_THICKNESS * np.sin(pitch + OUTER_TWIST))
    return result


def _wrapped(angle: Array) -> Array:
    result: Array = (angle + np.pi) % (2 * np.pi) - np.pi
    return result
