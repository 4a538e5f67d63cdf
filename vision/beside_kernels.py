"""Inner loops over the dots that lie beside lines, and over the places of a line at which its step goes on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]
Flags = NDArray[np.bool_]

ABOUT_PX = 160.0  # standard deviation of the weight about the place that a line was fitted about


@compiled
def shares_beyond(dots: Floats, normals: Floats, rhos: Floats, past_px: float) -> Floats:
    """Share (k,) of the dots (n, 2) that lie more than past_px past each of k lines, along its normal (k, 2)."""
    share = np.empty(len(rhos))
    for line in range(len(rhos)):
        nx, ny, limit, count = normals[line, 0], normals[line, 1], rhos[line] + past_px, 0
        for k in range(len(dots)):
            count += dots[k, 0] * nx + dots[k, 1] * ny > limit
        share[line] = count / len(dots)
    return share


@compiled
def stretches_beside(dots: Floats, normals: Floats, few: int, low: Floats, high: Floats) -> None:
    """The stretch (low, high) (k,) of each line that has dots (n, 2) beside it, but for a `few` at either end."""
    least, most = np.empty(few + 1), np.empty(few + 1)
    for line in range(len(normals)):
        nx, ny = normals[line, 0], normals[line, 1]
        for k in range(len(dots)):
            along = dots[k, 1] * nx - dots[k, 0] * ny
            if k <= few or along < least[few]:
                place = min(k, few)
                while place > 0 and least[place - 1] > along:
                    least[place] = least[place - 1]
                    place -= 1
                least[place] = along
            if k <= few or along > most[few]:
                place = min(k, few)
                while place > 0 and most[place - 1] < along:
                    most[place] = most[place - 1]
                    place -= 1
                most[place] = along
        low[line], high[line] = least[few], most[few]


@compiled
def outermost(dots: Floats, normals: Floats, but: int) -> Floats:
    """How far out (k,) along each normal (k, 2) the dots (n, 2) reach, `but` so many of them left out."""
    most, reach = np.empty(but + 1), np.empty(len(normals))
    for line in range(len(normals)):
        nx, ny = normals[line, 0], normals[line, 1]
        for k in range(len(dots)):
            out = dots[k, 0] * nx + dots[k, 1] * ny
            if k <= but or out > most[but]:
                place = min(k, but)
                while place > 0 and most[place - 1] < out:
                    most[place] = most[place - 1]
                    place -= 1
                most[place] = out
        reach[line] = most[but]
    return reach


@compiled
def shares_agreeing(t: Floats, agrees: Flags, low: Floats, high: Floats, fewest: int) -> Floats:
    """Share (k,) of the places t (k, m) of each line between low and high (k,) at which its step is there; of all
    places where fewer than `fewest` lie there."""
    share = np.empty(len(t))
    for line in range(len(t)):
        inside, there, all_there = 0, 0, 0
        for m in range(t.shape[1]):
            within = low[line] < t[line, m] < high[line]
            inside += within
            there += within and agrees[line, m]
            all_there += agrees[line, m]
        share[line] = there / inside if inside >= fewest else all_there / t.shape[1]
    return share


@compiled
def _dense(agrees: Flags, window: int, dense: Flags) -> None:
    """Whether more than half of the `window` places about each place agree."""
    places = len(agrees)
    for m in range(places):
        count = 0
        for i in range(max(m - window // 2, 0), min(m - window // 2 + window, places)):
            count += agrees[i]
        dense[m] = 2 * count > window


@compiled
def longest_runs(t: Floats, agrees: Flags, window: int, gap: float, first: Floats, last: Floats) -> None:
    """First and last place (k,) of the longest stretch of each line, at places t (k, m), on which steps go on with gaps
    no longer than `gap`; the line's first place twice where there is none."""
    lines, places = t.shape
    dense = np.empty(places, np.bool_)
    for line in range(lines):
        _dense(agrees[line], window, dense)
        length = max(t[line, 1] - t[line, 0], 1e-6)
        start, stop, best_start, best_stop = -1, -1, 0, 0
        for m in range(places):
            if not (dense[m] and agrees[line, m]):
                continue
            if start < 0 or (m - stop) * length > gap:
                start = m
            stop = m
            if stop - start > best_stop - best_start or best_stop == 0:
                best_start, best_stop = start, stop
        first[line], last[line] = t[line, best_start], t[line, best_stop]


@compiled
def runs_about(t: Floats, agrees: Flags, focus: Floats, window: int, gap: float, first: Floats, last: Floats) -> None:
    """First and last place (k,) between which each line's steps go on with gaps no longer than `gap`, most of them and
    nearest to its focus (k,); the whole line where steps are nowhere dense."""
    lines, places = t.shape
    dense = np.empty(places, np.bool_)
    for line in range(lines):
        _dense(agrees[line], window, dense)
        first[line], last[line] = t[line, 0], t[line, places - 1]
        length = t[line, 1] - t[line, 0]
        start, stop, total, most = 0, -places, 0.0, 0.0
        for m in range(places):
            if not dense[m]:
                continue
            if (m - stop) * length > gap:
                start, total = m, 0.0
            stop = m
            total += np.exp(-0.5 * ((t[line, m] - focus[line]) / ABOUT_PX) ** 2)
            if total > most:
                most, first[line], last[line] = total, t[line, start], t[line, m]


@compiled
def _median(values: Floats) -> Any:
    """Median of a few values; they are put in order."""
    count = len(values)
    for k in range(1, count):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value
    return 0.5 * (values[(count - 1) // 2] + values[count // 2])


@compiled
def facing(lines: Floats, dots: Floats, past_px: float, least: float, normals: Floats, rhos: Floats) -> int:
    """Write normals (k, 2) and rhos (k,) of those lines (n, 2) of (theta, rho) that have more than a least share of the
    dots on one side or no farther than -past_px on the other, turned outward; returned: how many, at most k."""
    count = 0
    for line in range(len(lines)):
        if count == len(rhos):
            break
        nx, ny, rho = np.cos(lines[line, 0]), np.sin(lines[line, 0]), lines[line, 1]
        within, without = 0, 0
        for k in range(len(dots)):
            across = dots[k, 0] * nx + dots[k, 1] * ny
            within += -across > -rho + past_px
            without += across > rho + past_px
        if max(within, without) / len(dots) <= least:
            continue
        sign = -1.0 if without > within else 1.0
        normals[count, 0], normals[count, 1], rhos[count] = sign * nx, sign * ny, sign * rho
        count += 1
    return count


@compiled
def told_beside(
    dots: Floats, normals: Floats, rhos: Floats, t: Floats, agrees: Flags, past_px: float, share_left: float,
    room_px: float, fewest: int, window_px: float, gap: float, told: Floats,
) -> None:  # fmt: skip
    """Of k lines, written to told (6, k): the share of the dots past_px past each; the stretch, first and last, that
    has dots beside it, but for a share of them at either end; the share of its places at which the line's step is
    there; and the first and the last place of the longest stretch on which it goes on with gaps no longer than `gap`.
    """
    if len(rhos) == 0:
        return
    told[0] = shares_beyond(dots, normals, rhos, past_px)
    low, high = told[1], told[2]
    stretches_beside(dots, normals, round(share_left * (len(dots) - 1)), low, high)
    told[3] = shares_agreeing(t, agrees, low - room_px, high + room_px, fewest)
    window = min(max(round(window_px / max(_median(t[:, 1] - t[:, 0]), 1e-6)), 3), 9)
    longest_runs(t, agrees, window, gap, told[4], told[5])
