"""Weighs lines as edges of the blade: what speaks for each, from its steps, the dots beside it and the other eye."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.camera import StereoPair
from vision.capture import Image
from vision.lines import Profiles, refine_lines, sampled, steps
from vision.surface import Surface

Array = NDArray[Any]  # of floats

CANDIDATES = 30
LAST_SAMPLES = 84  # profiles along a line when it is measured for good
LEAST_SUPPORT = 0.5
INWARD_STEP, INWARD_SAMPLES, INWARD_PLACES = 3.0, 56, 24
LONGEST_GAP = 45.0  # px over which an edge may be unseen and still go on
ROUND_M = 1.0  # how far behind the surface before the camera a thick blade's edge may lie
PARALLAX_PX, PARALLAX_SAMPLES = 5.0, 19  # how far about that range the other eye's step is looked for
PLANE_PX = 4.0  # how far from a line a dot must lie to count on one side of it


@dataclass(frozen=True)
class Blade:
    """The dots of the blade (n, 2), and where dots would be if it went on but are none, (m, 2); image frame, working
    px.

    texture: how strong steps on the blade itself are, between neighbouring dots, in grey levels.
    strays: share of the dots that may lie beyond an edge all the same. grid_known: `absent` rests on the laser's own
    grid.
    """

    dots: Array
    absent: Array
    texture: float
    strays: float = 0.03
    grid_known: bool = True


@dataclass(frozen=True)
class OtherEye:
    """The other eye's smoothed image and what is needed to look up a point of the blade's surface there."""

    smooth: Image
    stereo: StereoPair
    surface: Surface


@dataclass(frozen=True, eq=False)
class Candidate:
    """A refined line with its outward normal and offset (image frame, working px) and what speaks for it.

    support: share of the stretch beside the dots on which there is a step. parallax: share of that which the other
    eye sees at the blade's depth. step: its height in grey levels. blocked: share of that stretch on which a step as
    strong lies between dots and line. empty: share of the dots expected up to the line that are missing. beyond:
    missing ones past the line.
    ends: places between which the step goes on, along the direction `profile.direction[index]`.
    """

    outward: Array
    rho: float
    support: float
    parallax: float
    step: float
    blocked: float
    empty: float
    beyond: int
    ends: tuple[float, float]
    value: float
    profile: Profiles
    index: int


def texture_between(smooth: Image, dots: Array) -> float:
    """How strong the steps between neighbouring dots are: what the blade's own dirt and shade do. dots (n, 2) in
    pixels."""
    if len(dots) < 3:
        return 0.0
    apart = np.hypot(*(dots[:, None] - dots[None]).transpose(2, 0, 1))
    first, second = np.nonzero(np.triu((apart > 16) & (apart < 44), 1))
    if len(first) == 0:
        return 0.0
    share = np.linspace(0.0, 1.0, 12)[:, None, None]
    points = dots[first] * (1 - share) + dots[second] * share
    change = np.abs(steps(sampled(smooth, points[..., 0].T, points[..., 1].T)))
    return float(np.quantile(change.max(axis=1), 0.8))


def weigh(lines: Array, blade: Blade, smooth: Image, noise: float, other: OtherEye | None) -> list[Candidate]:
    """Candidates out of lines (k, 2) of (theta, signed rho), refined, with what speaks for them."""
    dots = blade.dots
    normal = np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    rho = lines[:, 1]
    distance = dots @ normal.T - rho  # (dots, lines), positive beyond the line along its normal
    inside, outside = (distance < 7).mean(axis=0), (distance > -7).mean(axis=0)
    flip = outside > inside
    keep = np.maximum(inside, outside) > 0.99 - blade.strays
    normal[flip], rho = -normal[flip], np.where(flip, -rho, rho)
    normal, rho = normal[keep][:CANDIDATES], rho[keep][:CANDIDATES]
    if len(rho) == 0:
        return []
    for reach, slopes, samples in ((8, 2.4, 40), (4, 0.6, LAST_SAMPLES)):
        low, high = _beside(dots, normal)
        profile = refine_lines(smooth, normal, rho, noise, np.clip(0.0, low, high), reach, slopes, samples)
        normal, rho = profile.normal, profile.rho
        low, high = _beside(dots, normal)
        beside, support = _support(profile, low, high)
        if samples < LAST_SAMPLES:
            promising = np.flatnonzero(
                (support > 0.6 * LEAST_SUPPORT) & ((dots @ normal.T - rho > 5).mean(axis=0) < 0.2)
            )
            if len(promising) == 0:
                return []
            normal, rho = normal[promising], rho[promising]
    crossed = (dots @ normal.T - rho > 2.5).mean(axis=0)
    on_side = crossed <= blade.strays
    good = np.flatnonzero(on_side & (support >= LEAST_SUPPORT))
    if len(good) == 0:
        return []
    profile = profile.take(good)
    crossed = crossed[good]
    beside, support, low, high = beside[good], support[good], low[good], high[good]
    step = _typical_step(profile, beside)
    parallax = _parallax(profile, other, beside, noise) if other is not None else np.full(len(good), np.nan)
    blocked = _blocked(profile, blade, smooth, step, low, high, noise)
    gaps = [_missing(blade, profile.normal[k], float(profile.rho[k]), low[k], high[k]) for k in range(len(good))]
    empties = np.array([gap[0] for gap in gaps])
    likely = (blocked < 0.5) & ~(parallax < 0.4) & (empties < 0.3)
    strongest = max(float(np.max(np.where(likely, step, 0))), 1.0)
    found = []
    for k in range(len(good)):
        empty, beyond = gaps[k]
        told = parallax[k]
        value = (
            2.0 * support[k]
            + 0.35 * float(np.clip(np.log2(step[k] / strongest), -3.0, 0.5))
            + 0.35 * float(np.clip(np.log2(step[k] / max(blade.texture, 1.0)), -2.0, 1.0))
            + (0.2 if np.isnan(told) else 0.6 * told if told > 0.5 else -7.0 * (0.5 - told))
            - 2.0 * blocked[k]
            - 3.0 * max(blocked[k] - 0.5, 0.0)
            - (5.0 if blade.grid_known else 2.5) * empty
            - 5.0 * crossed[k]
            + 0.15 * min(beyond, 6)
        )
        found.append(
            Candidate(
                profile.normal[k],
                float(profile.rho[k]),
                float(support[k]),
                float(parallax[k]),
                float(step[k]),
                float(blocked[k]),
                empty,
                beyond,
                run_of(profile, k),
                float(value),
                profile,
                k,
            )
        )
    return found


def _support(profile: Profiles, low: Array, high: Array) -> tuple[NDArray[np.bool_], Array]:
    """Which places (k, m) have dots beside them, all where too few have, and the share (k,) of them that agree."""
    beside = (profile.t > low[:, None] - 8) & (profile.t < high[:, None] + 8)
    beside[beside.sum(axis=1) < 6] = True
    return beside, (profile.agrees & beside).sum(axis=1) / beside.sum(axis=1)


def _beside(dots: Array, normal: Array) -> tuple[Array, Array]:
    """The stretch (low, high) (k,) of each line that has dots beside it."""
    along = dots @ np.stack([-normal[:, 1], normal[:, 0]])
    along.sort(axis=0)
    few = round(0.04 * (len(along) - 1))
    return along[few], along[len(along) - 1 - few]


def _typical_step(profile: Profiles, beside: NDArray[np.bool_]) -> Array:
    steps = np.where(profile.agrees & beside, np.abs(profile.step), np.nan)
    none = ~np.isfinite(steps).any(axis=1)
    steps[none] = 0.0
    return np.asarray(np.nanmedian(steps, axis=1), float)


def run_of(profile: Profiles, k: int) -> tuple[float, float]:
    """The places about its focus between which the steps of line k go on with small gaps."""
    t, agrees, focus = profile.t[k], profile.agrees[k], float(profile.focus[k])
    share = np.convolve(agrees, np.ones(7) / 7, mode="same") > 0.5
    at = int(np.argmin(np.abs(t - focus)))
    if not share[at]:
        near = np.flatnonzero(share)
        if len(near) == 0:
            return float(t[0]), float(t[-1])
        at = int(near[np.argmin(np.abs(near - at))])
    length = t[1] - t[0]
    first, last = at, at
    for k in (np.flatnonzero(share[at:]) + at).tolist():
        if (k - last) * length > LONGEST_GAP:
            break
        last = int(k)
    for k in np.flatnonzero(share[: at + 1])[::-1].tolist():
        if (first - k) * length > LONGEST_GAP:
            break
        first = int(k)
    return float(t[first]), float(t[last])


def _missing(blade: Blade, normal: Array, rho: float, low: float, high: float) -> tuple[float, int]:
    """Share of missing dots among those expected inside the line, beside the seen ones, and how many are missing
    beyond."""
    direction = np.array([-normal[1], normal[0]])
    if len(blade.absent) == 0:
        return 0.0, 0
    along, distance = blade.absent @ direction, blade.absent @ normal - rho
    near = (along > low - 10) & (along < high + 10)
    innermost = float(np.median(blade.dots @ normal)) - rho
    gone = int((near & (distance < -PLANE_PX) & (distance > innermost)).sum())
    there = int((blade.dots @ normal - rho > innermost).sum())
    return gone / max(gone + there, 1), int((near & (distance > PLANE_PX) & (distance < 45)).sum())


def _blocked(
    profile: Profiles, blade: Blade, smooth: Image, step: Array, low: Array, high: Array, noise: float
) -> Array:
    """Share (k,) of the stretch beside the dots on which a step as strong as the line's own, and stronger than the
    blade's texture, lies between the outermost dots and the line."""
    height, width = smooth.shape[:2]
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    share = (np.arange(INWARD_PLACES) + 0.5) / INWARD_PLACES
    places = low[:, None] + (high - low)[:, None] * share
    inward = 5.0 + INWARD_STEP * np.arange(INWARD_SAMPLES)
    points = profile.normal[:, None] * profile.rho[:, None, None] + places[..., None] * profile.direction[:, None]
    u = points[..., 0, None] - inward * profile.normal[:, 0, None, None] + centre[0]
    v = points[..., 1, None] - inward * profile.normal[:, 1, None, None] + centre[1]
    change = np.abs(steps(sampled(smooth, u, v)))
    depth = (
        profile.rho[:, None]
        - np.sort(blade.dots @ profile.normal.T, axis=0)[round(0.85 * (len(blade.dots) - 1)), :, None]
    )
    within = inward[1:-1] < np.maximum(depth - 3, 0)
    strongest = np.where(within[:, None], change, 0).max(axis=2)
    threshold = np.maximum(np.maximum(0.7 * step, 1.7 * blade.texture), 3.0 * noise)
    return np.asarray((strongest > threshold[:, None]).mean(axis=1), float)


def _parallax(profile: Profiles, other: OtherEye, beside: NDArray[np.bool_], noise: float) -> Array:
    """Share (k,) of the agreeing places whose step the other eye sees where the blade's surface puts it.

    NaN where the line's parallax against the far background is too small to tell them apart.
    """
    stereo, surface = other.stereo, other.surface
    height, width = other.smooth.shape[:2]
    t, agrees, step = (values[:, ::2] for values in (profile.t, profile.agrees & beside, profile.step))
    lines, places = t.shape
    points = (profile.normal * profile.rho[:, None])[:, None] + t[..., None] * profile.direction[:, None]
    rays = stereo.left.rays((points + stereo.left.centre).reshape(-1, 2))
    inverse = np.clip((1 - rays[:, 1:] @ surface.slope) / surface.depth_m, 0.02, 1.5)

    def seen_at(depth: Array) -> Array:
        """Pixels (lines, places, 2) of the right eye, for points at depths along the left eye's rays."""
        return stereo.right.project((rays * depth[:, None]) @ stereo.rotation.T + stereo.translation).reshape(
            lines, places, 2
        )

    there, deeper = seen_at(1 / inverse), seen_at(1 / inverse + ROUND_M)
    far = stereo.right.project(rays @ stereo.rotation.T).reshape(lines, places, 2)
    normal = profile.normal[:, None]
    telling = np.abs(((deeper - far) * normal).sum(axis=2)).mean(axis=1) > 6.0
    behind = ((deeper - there) * normal).sum(axis=2)[..., None]
    reach = np.linspace(-1.0, 1.0, PARALLAX_SAMPLES)
    across = np.minimum(behind, 0) + (np.abs(behind) + 2 * PARALLAX_PX) * (reach + 1) / 2 - PARALLAX_PX
    u = there[..., 0, None] + across * profile.normal[:, 0, None, None]
    v = there[..., 1, None] + across * profile.normal[:, 1, None, None]
    raw = steps(sampled(other.smooth, u, v))
    gradient: Array = (raw + np.roll(raw, 1, 1) + np.roll(raw, -1, 1)) / 3
    middle = PARALLAX_SAMPLES // 2
    seen = (u[..., middle] > 4) & (v[..., middle] > 4)
    seen &= (u[..., middle] < width - 5) & (v[..., middle] < height - 5)
    seen &= agrees
    like = np.abs(gradient)
    strong = like.max(axis=2) > np.maximum(0.4 * np.abs(step), 1.2 * noise)
    share = (strong & seen).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    return np.asarray(np.where(telling & (seen.sum(axis=1) >= 5), share, np.nan), float)
