"""Finds the blade's edges: lines with every dot of the blade on one side, unbroken beside those dots, at the blade's depth.

A line of the background (horizon, tower, another blade, a cable) ends where the blade hides it, and it has another parallax
than the blade; a seam or a streak on the blade has dots on both sides. The edges of one blade are nearly parallel.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import StereoPair
from vision.capture import Image
from vision.lines import Profiles, edge_pixels, grey_noise, hough_lines, refine_lines
from vision.observation import Edge, Line
from vision.surface import Surface

Array = NDArray[np.float64]

CANDIDATES = 28
LEAST_SUPPORT = 0.55
LARGEST_TAPER = np.deg2rad(16)


@dataclass(frozen=True)
class Candidate:
    """A refined line with its outward normal and offset (image frame, working px), the share of the stretch beside the dots
    on which there is a step, of its whole visible stretch, and of where the other eye sees the step at the blade's depth."""

    outward: Array
    rho: float
    support: float
    overall: float
    parallax: float
    step: float
    profile: Profiles
    index: int

    @property
    def score(self) -> float:
        return self.support * (0.35 + 0.65 * self.parallax) + 0.25 * self.overall


@dataclass(frozen=True)
class OtherEye:
    """The other eye's smoothed image and what is needed to look up a point of the blade's surface there."""

    smooth: Image
    stereo: StereoPair
    surface: Surface


def find_edges(
    grey: Image, seeds: Array, spots: Array, other: OtherEye | None
) -> tuple[tuple[Candidate, ...], float, tuple[str, ...]]:
    """The blade's edges (none, one or two), the direction of its axis modulo π, and reasons where none is found.

    grey (h, w): working image. seeds (n, 2): pixels of dots on the blade. spots (m, 2): pixels of all spots, masked out.
    The axis is NaN where no edge gives it.
    """
    height, width = grey.shape
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    noise = grey_noise(grey)
    smooth = cv2.blur(grey, (3, 3))
    dots = seeds - centre
    lines, _ = hough_lines(edge_pixels(grey, noise, spots), 160, (width, height))
    candidates = _refined(lines, dots, smooth, noise, other)
    chosen = _choose(candidates, dots)
    if not chosen:
        best = max((c.support for c in candidates), default=0.0)
        return (), float("nan"), (f"no edge: the best line beside the dots has {best:.0%} support",)
    directions = np.array([np.arctan2(c.outward[1], c.outward[0]) + np.pi / 2 for c in chosen])
    axis = 0.5 * np.angle(np.exp(2j * directions).sum()) % np.pi
    return chosen, float(axis), ()


def _refined(lines: Array, dots: Array, smooth: Image, noise: float, other: OtherEye | None) -> list[Candidate]:
    normal = np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    rho = lines[:, 1]
    distance = dots @ normal.T - rho  # (dots, lines), positive beyond the line along its normal
    inside, outside = (distance < 5).mean(axis=0), (distance > -5).mean(axis=0)
    flip = outside > inside
    keep = np.maximum(inside, outside) >= 0.96
    normal[flip], rho = -normal[flip], np.where(flip, -rho, rho)
    normal, rho = normal[keep][:CANDIDATES], rho[keep][:CANDIDATES]
    if len(rho) == 0:
        return []
    for reach, slopes in ((7, 2.0), (4, 0.6)):
        focus = np.median(dots @ np.stack([-normal[:, 1], normal[:, 0]]), axis=0)
        profile = refine_lines(smooth, normal, rho, noise, focus, reach, slopes)
        normal, rho = profile.normal, profile.rho
    along = dots @ profile.direction.T
    low, high = np.quantile(along, 0.04, axis=0) - 8, np.quantile(along, 0.96, axis=0) + 8
    beside = (profile.t > low[:, None]) & (profile.t < high[:, None])
    parallax = _parallax(profile, other, beside, noise) if other is not None else np.full(len(rho), 1.0)
    found = []
    for k in range(len(rho)):
        distance_k = dots @ normal[k] - rho[k]
        if (distance_k > 2.5).mean() > 0.03:
            continue
        near = beside[k] if beside[k].sum() >= 6 else np.ones_like(beside[k])
        step = profile.step[k][profile.agrees[k] & near]
        found.append(
            Candidate(
                normal[k],
                float(rho[k]),
                float(profile.agrees[k][near].mean()),
                float(profile.agrees[k].mean()),
                float(parallax[k]),
                float(np.median(np.abs(step))) if len(step) else 0.0,
                profile,
                k,
            )
        )
    return found


def _parallax(profile: Profiles, other: OtherEye, beside: NDArray[np.bool_], noise: float) -> Array:
    """Share (k,) of the agreeing places whose step the other eye sees where the blade's surface puts it.

    1 where the line's parallax against the far background is too small to tell them apart.
    """
    stereo, surface = other.stereo, other.surface
    height, width = other.smooth.shape
    lines, places = profile.t.shape
    foot = profile.normal * profile.rho[:, None]
    points = foot[:, None] + profile.t[..., None] * profile.direction[:, None]
    across = np.arange(-5, 6, dtype=float)
    rays = stereo.left.rays((points + stereo.left.centre).reshape(-1, 2))
    slope = surface.slope
    inverse = (1 - rays[:, 1:] @ slope) / surface.depth_m
    inverse = np.clip(inverse, 0.02, 1.5)
    there = stereo.right.project((rays / inverse[:, None]) @ stereo.rotation.T + stereo.translation)
    far = stereo.right.project(rays @ stereo.rotation.T)
    shift = ((there - far).reshape(lines, places, 2) * profile.normal[:, None]).sum(axis=2)
    telling = np.abs(shift).mean(axis=1) > 6.0
    there = there.reshape(lines, places, 2)
    u = (there[..., 0, None] + across * profile.normal[:, 0, None, None]).astype(np.float32)
    v = (there[..., 1, None] + across * profile.normal[:, 1, None, None]).astype(np.float32)
    values = cv2.remap(
        other.smooth,
        u.reshape(-1, len(across)),
        v.reshape(-1, len(across)),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    ).reshape(u.shape)
    gradient = values[..., 2:].astype(np.float32) - values[..., :-2].astype(np.float32)
    gradient = (gradient + np.roll(gradient, 1, 1) + np.roll(gradient, -1, 1)) / 3
    seen = (u[..., 5] > 4) & (v[..., 5] > 4) & (u[..., 5] < width - 5) & (v[..., 5] < height - 5)
    seen &= profile.agrees
    like = gradient * np.sign(profile.step)[..., None]
    strong = like.max(axis=2) > np.maximum(0.4 * np.abs(profile.step), 1.2 * noise)
    share = (strong & seen).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    use = telling & (seen.sum(axis=1) >= 8)
    return np.where(use, share, 0.8)


def _choose(candidates: list[Candidate], dots: Array) -> tuple[Candidate, ...]:
    """The pair of nearly parallel candidates that encloses the dots best, or the best one, or none."""
    good = [c for c in candidates if c.support >= LEAST_SUPPORT and c.parallax >= 0.3]
    if not good:
        return ()
    reach = [float((c.rho - dots @ c.outward).min()) for c in good]
    value = [c.score - 0.0006 * max(d, 0.0) for c, d in zip(good, reach, strict=True)]
    best_pair: tuple[float, tuple[int, int]] | None = None
    for a in range(len(good)):
        for b in range(a + 1, len(good)):
            opposite = float(-good[a].outward @ good[b].outward)
            if opposite < np.cos(LARGEST_TAPER):
                continue
            total = value[a] + value[b]
            if best_pair is None or total > best_pair[0]:
                best_pair = (total, (a, b))
    single = int(np.argmax(value))
    if best_pair is not None and min(value[k] for k in best_pair[1]) > 0.6 * value[single]:
        return tuple(good[k] for k in best_pair[1])
    return (good[single],)


def edge_of(candidate: Candidate, factor: int) -> Edge:
    """The candidate as an edge in pixels of the full image."""
    rho = candidate.rho * factor
    normal = candidate.outward if rho >= 0 else -candidate.outward
    profile, k = candidate.profile, candidate.index
    places = profile.t[k][profile.agrees[k]]
    ends = np.array([places.min(), places.max()]) if len(places) else profile.t[k][[0, -1]]
    direction = profile.direction[k]
    return Edge(
        Line(float(np.arctan2(normal[1], normal[0])), abs(float(rho))),
        candidate.outward.copy(),
        float(np.hypot(profile.slope_sigma[k], 0.0008)),
        float(profile.rho_sigma[k] * factor),
        candidate.support,
        (candidate.outward * candidate.rho + ends[:, None] * direction) * factor,
    )
