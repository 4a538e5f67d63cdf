"""First guesses of a rotor in a picture, from straight edges alone.

Two lines that close slowly may be the edges of a blade, and its axis then runs through the point where they meet. Two
such blades, 120° apart, that have one length and one width around the crossing of their axes may be a rotor: horizon,
tower and fields do not have this symmetry, and the third blade may be hard to tell from the tower that it hides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ANGLES = 180  # bins of the accumulator, modulo 180°
RHO_STEP = 2.0
MOST_LINES = 100
SPACING = np.deg2rad(9.0)  # how far from 120° perspective may bring two blades
CLOSING = np.deg2rad(1.0), np.deg2rad(15.0)  # by which angle the edges of a blade approach each other
LEADING_SHARE = 0.31  # of a blade's width lies before its axis: blades turn about their front third
LENGTH = 0.2, 3.0  # of the image's diagonal, from the hub to where the edges would meet
MOST_TRIED = 150


@dataclass(frozen=True)
class Guess:
    """hub (2,) in the image frame, px. directions (3,) of the blades' axes, rad clockwise from +y_im. At a distance r
    from the hub the edges lie at leading · (1 - r / length) clockwise and at trailing · (1 - r / length)
    counter-clockwise of the axis, all in px. score: votes of the six lines."""

    hub: Array
    directions: Array
    leading: float
    trailing: float
    length: float
    score: float


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
    axis = direction[one] + LEADING_SHARE * closing
    offset = apex[:, 1] * np.cos(axis) - apex[:, 0] * np.sin(axis)
    return _Blades(axis % (2 * np.pi), offset, apex, closing, strength[one] + strength[other])


def guesses(planes: NDArray[np.float32], near: Array | None, within_px: float, most: int = 6) -> list[Guess]:
    """First guesses of the rotor, the best first. near (2,): where the hub is expected in the image frame, within so
    much.

    Two blades 120° apart that have one length and one width at the point where their axes cross make a rotor; lines
    where the third one must be add to its score.
    """
    height, width = planes.shape[:2]
    diagonal = float(np.hypot(width, height))
    lines, votes = strongest_lines(planes)
    blades = _blades(lines, votes)
    gap = (blades.direction[None, :] - blades.direction[:, None]) % (2 * np.pi)
    one, other = np.nonzero(np.abs(gap - 2 * np.pi / 3) < SPACING)
    d1, d2 = blades.direction[one], blades.direction[other]
    cross = np.sin(d2 - d1)
    o1, o2 = blades.offset[one], blades.offset[other]
    # The axes v·p = o with v = (-sin d, cos d) cross at the hub.
    hub = np.stack([o1 * np.cos(d2) - o2 * np.cos(d1), o1 * np.sin(d2) - o2 * np.sin(d1)], axis=-1) / cross[:, None]
    lengths = np.stack(
        [
            (blades.apex[k] - hub)[:, 0] * np.cos(d) + (blades.apex[k] - hub)[:, 1] * np.sin(d)
            for k, d in ((one, d1), (other, d2))
        ]
    )
    widths = lengths * np.tan(np.stack([blades.closing[one], blades.closing[other]]))
    good = np.all(np.abs(hub) < 0.95 * np.array([width, height]) / 2, axis=1)
    if near is not None:
        good &= np.linalg.norm(hub - near, axis=1) < within_px
    good &= np.all((lengths > LENGTH[0] * diagonal) & (lengths < LENGTH[1] * diagonal), axis=0)
    good &= np.all((widths > 0.006 * diagonal) & (widths < 0.2 * diagonal), axis=0)
    good &= np.abs(np.log(np.maximum(widths[0], 1) / np.maximum(widths[1], 1))) < np.log(1.4)
    good &= np.abs(np.log(np.maximum(lengths[0], 1) / np.maximum(lengths[1], 1))) < np.log(1.6)
    one, other, hub, lengths, widths = one[good], other[good], hub[good], lengths[:, good], widths[:, good]
    score = blades.votes[one] + blades.votes[other]
    found: list[Guess] = []
    for k in np.argsort(-score, kind="stable")[:MOST_TRIED]:
        first, second = blades.direction[one[k]], blades.direction[other[k]]
        third = first + np.angle(np.exp(1j * (second - first))) / 2 + np.pi
        length, wide = float(np.sqrt(lengths[:, k].prod())), float(np.sqrt(widths[:, k].prod()))
        directions = np.array([first, second, third]) % (2 * np.pi)
        guess = Guess(hub[k], directions, LEADING_SHARE * wide, (1 - LEADING_SHARE) * wide, length, float(score[k]))
        guess = replace(guess, score=guess.score + _third(guess, lines, votes))
        rival = next((i for i, g in enumerate(found) if not _apart(guess, g)), None)
        if rival is None:
            found.append(guess)
        elif guess.score > found[rival].score:
            found[rival] = guess
    return sorted(found, key=lambda g: -g.score)[:most]


def _third(guess: Guess, lines: Array, votes: Array) -> float:
    """Votes of the lines nearest to where the edges of the blade that was not used must be."""
    total = 0.0
    for root, side in ((guess.leading, 1.0), (guess.trailing, -1.0)):
        direction = guess.directions[2] - side * root / guess.length
        normal = np.array([-np.sin(direction), np.cos(direction)])
        turn = _wrapped(2 * (lines[:, 0] - direction - np.pi / 2)) / 2
        oriented = np.where(np.cos(lines[:, 0] - direction - np.pi / 2) > 0, 1.0, -1.0) * lines[:, 1]
        off = oriented - normal @ guess.hub - side * root
        close = (np.abs(turn) < np.deg2rad(4)) & (np.abs(off) < 0.5 * (guess.leading + guess.trailing) + 4)
        total += float(np.minimum(votes[close], 120).max(initial=0.0))
    return total


def _apart(one: Guess, other: Guess) -> bool:
    turn = _wrapped(3 * (one.directions[0] - other.directions[0])) / 3
    return bool(np.linalg.norm(one.hub - other.hub) > 10 or abs(turn) > np.deg2rad(3))


def _wrapped(angle: Array) -> Array:
    result: Array = (angle + np.pi) % (2 * np.pi) - np.pi
    return result
