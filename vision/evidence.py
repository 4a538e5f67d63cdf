"""What speaks for a line as an edge of the blade: its steps, the dots beside it, what lies before it, the other eye."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.beside_kernels import outermost, runs_about, stretches_beside, told_beside
from vision.camera import Camera, StereoPair
from vision.capture import Image
from vision.evidence_kernels import lines_before, median_steps, missing_dots, shares_above, without_shade
from vision.lane_kernels import shares_at_depth, steps_before, steps_between
from vision.lines import Profiles
from vision.surface import Surface

Array = NDArray[Any]  # of floats

FIRST_INWARD, INWARD_STEP, INWARD_SAMPLES, INWARD_PLACES = 5.0, 3.0, 56, 24
MOST_ALONG, STEEPEST = 0.3, 0.5  # share of the places with a step before a line that make it one, and its slope at most
INWARD_SHARES = (np.arange(INWARD_PLACES) + 0.5) / INWARD_PLACES  # where those places lie along a stretch
LONGEST_GAP = 45.0  # px over which an edge may be unseen and still go on
ROUND_M = 1.0  # how far behind the surface before the camera a thick blade's edge may lie
ACROSS, GRADUAL, SHADED = 2, 0.45, 8  # samples across a sharp step, how much of a change is left so far inward, how far
PARALLAX_PX, PARALLAX_SAMPLES = 5.0, 19  # how far about that range the other eye's step is looked for
PARALLAX_STEP = 0.4  # of a step, what the other eye has to see of it
LEAST_PARALLAX_PX, LEAST_PLACES = 6.0, 5  # against the far background, and places with a step, that tell depths apart
WITHIN = 0.95  # of the dots, past which a step before a line is looked for
PLANE_PX = 4.0  # how far from a line a dot must lie to count on one side of it
BEYOND_PX = 45.0  # so far past a line missing dots tell that the blade ends there
RUN_PLACES = 7  # along a line, of which most must show a step


@dataclass(frozen=True)
class Blade:
    """The dots of the blade (n, 2), and where dots would be if it went on but are none, (m, 2); image frame, working
    px.

    texture: how strong steps on the blade itself are, between neighbouring dots, in grey levels.
    strays: share of the dots that may lie beyond an edge all the same. grid_known: `absent` rests on the laser's own
    grid.
    slope (2,): of the surface, change of depth to the right and down; focal: in working px; camera: that sees it, of
    the working image; None where unknown. behind (m, 2): dots far behind the blade.
    """

    dots: Array
    absent: Array
    texture: float
    strays: float = 0.03
    grid_known: bool = True
    slope: Array | None = None
    focal: float = 616.0
    camera: Camera | None = None
    behind: Array = field(default_factory=lambda: np.empty((0, 2)))

    @cached_property
    def spacing(self) -> float:
        """Usual distance in px from a dot to the nearest other one, of two dots at least."""
        apart = np.hypot(*(self.dots[:, None] - self.dots).transpose(2, 0, 1))
        np.fill_diagonal(apart, np.inf)
        return float(np.median(apart.min(axis=1)))

    def on_surface(self, point: Array, way: Array) -> Array:
        """Unit vector (3,) on the surface that is seen as `way` (2,) at `point` (2,) of the image."""
        (u, v), (x, y), focal = point.tolist(), way.tolist(), self.focal
        right, down = (0.0, 0.0) if self.slope is None else self.slope.tolist()
        lean = (right * x + down * y) / max(1.0 - (right * u + down * v) / focal, 0.2)
        x, y = x + u / focal * lean, y + v / focal * lean
        return np.array([lean, x, y]) / sqrt(lean * lean + x * x + y * y)

    def skew(self, point: Array, toward: Array) -> float:
        """How much farther along `toward` (2,) a line across the blade, square to its axis on the surface, gets in the
        image at `point` (2,) per px to the side."""
        if self.slope is None:
            return 0.0
        ray = point / self.focal
        lean = self.slope / max(1.0 - float(self.slope @ ray), 0.2)
        (x, y), (ray_x, ray_y) = toward.tolist(), ray.tolist()
        deeper, aside = float(lean @ toward), float(lean[1] * x - lean[0] * y)
        one = (deeper, x + ray_x * deeper, y + ray_y * deeper)
        two = (aside, -y + ray_x * aside, x + ray_y * aside)
        return float(-sum(a * b for a, b in zip(one, two, strict=True)) / sum(a * a for a in one))


@dataclass(frozen=True)
class OtherEye:
    """The other eye's smoothed image and what is needed to look up a point of the blade's surface there."""

    smooth: Image
    stereo: StereoPair
    surface: Surface

    def shows(self, points: Array) -> Array:
        """Pixels (3, n, 2) at which it sees points (n, 2) of the left eye's image frame: on the plane of the surface,
        ROUND_M behind that, and infinitely far off."""
        rays = self.stereo.left.rays(points + self.stereo.left.centre)
        inverse = np.clip((1 - rays[:, 1:] @ self.surface.slope) / self.surface.depth_m, 0.02, 1.5)
        depth, turned, aside = (1 / inverse)[:, None], rays @ self.stereo.rotation.T, self.stereo.translation
        seen = np.stack((turned * depth + aside, turned * (depth + ROUND_M) + aside, turned))
        return self.stereo.right.project(seen).reshape(3, -1, 2)


def texture_between(smooth: Image, dots: Array) -> float:
    """How strong the steps between neighbouring dots are: what the blade's own dirt and shade do. dots (n, 2) in
    pixels."""
    if len(dots) < 3:
        return 0.0
    change = steps_between(smooth, np.ascontiguousarray(dots), 16.0, 44.0, np.linspace(0.0, 1.0, 12))
    if len(change) == 0:
        return 0.0
    change.sort()
    place = 0.8 * (len(change) - 1)
    below, part = int(place), place - int(place)
    return float(change[below] + part * (change[min(below + 1, len(change) - 1)] - change[below]))


def told_by_dots(profile: Profiles, dots: Array, past_px: float) -> Array:
    """(crossed, low, high, support, first, last) (6, k) of k lines: the share of the dots more than past_px past each,
    the stretch of it that has dots beside it, the share of that at which there is its step, and the longest stretch on
    which this goes on with small gaps."""
    told = np.empty((6, len(profile.rho)))
    told_beside(
        dots, profile.normal, profile.rho, profile.t, profile.agrees, past_px, 0.04, 8.0, 6, 28.0, LONGEST_GAP, told
    )
    return told


def beside(dots: Array, normal: Array) -> tuple[Array, Array]:
    """The stretch (low, high) (k,) of each line that has dots beside it."""
    low, high = np.empty((2, len(normal)))
    stretches_beside(dots, normal, round(0.04 * (len(dots) - 1)), low, high)
    return low, high


def typical_step(profile: Profiles, within: NDArray[np.bool_]) -> Array:
    """Median height (k,) of the agreeing steps, in grey levels."""
    median = np.empty(len(within))
    median_steps(profile.step, profile.agrees, within, median)
    return median


def runs_at_focus(profile: Profiles) -> tuple[Array, Array]:
    """The places (k,) about each line's focus between which its steps go on with small gaps."""
    first, last = np.empty((2, len(profile.t)))
    runs_about(profile.t, profile.agrees, profile.focus, RUN_PLACES, LONGEST_GAP, first, last)
    return first, last


def missing(blade: Blade, profile: Profiles, low: Array, high: Array) -> tuple[Array, NDArray[np.int64]]:
    """Share (k,) of missing dots among those expected inside each line, between low and high (k,) along it, and how
    many (k,) are missing beyond."""
    empty, beyond = np.zeros(len(low)), np.zeros(len(low), np.int64)
    if len(blade.absent):
        missing_dots(
            blade.dots, blade.absent, profile.normal, profile.rho, low, high, PLANE_PX, BEYOND_PX, empty, beyond
        )
    return empty, beyond


def seen_before(blade: Blade, profile: Profiles, low: Array, high: Array) -> NDArray[np.int64]:
    """How many dots far behind the blade (k,) are seen before each line, farther out than half of the blade's own,
    between low and high (k,) along it: there it is not the blade that the line bounds."""
    if len(blade.behind) == 0:
        return np.zeros(len(low), np.int64)
    across, along = profile.normal @ blade.behind.T, profile.direction @ blade.behind.T
    middle = np.median(profile.normal @ blade.dots.T, axis=1)
    inside = (across < profile.rho[:, None] - PLANE_PX) & (across > middle[:, None])
    inside &= (along > low[:, None]) & (along < high[:, None])
    return np.asarray(inside.sum(axis=1))


def blocked(
    profile: Profiles, blade: Blade, smooth: Image, step: Array, low: Array, high: Array, noise: float
) -> Array:
    """Share (k,) of the stretch between low and high on which a step as strong as the line's own, and stronger than
    the blade's texture, lies between the outermost dots and the line. Where the blade rounds away from the light it
    darkens toward its edge, the faster the nearer, as no step does: such shade is none."""
    change, _ = _steps_before(profile, blade, smooth, low, high)
    threshold = np.maximum(np.maximum(0.7 * step, 1.7 * blade.texture), 3.0 * noise)
    without_shade(change, noise, ACROSS, GRADUAL, SHADED)
    return np.asarray(shares_above(change, threshold))


def nearer_lines(
    profile: Profiles, blade: Blade, smooth: Image, step: Array, low: Array, high: Array, noise: float
) -> tuple[Array, Array]:
    """Lines (normal (n, 2), rho (n,)) through the first steps outward of the outermost dots, where such lie before
    the lines: what is nearest to the dots hides what is behind."""
    change, places = _steps_before(profile, blade, smooth, low, high)
    threshold = np.maximum(np.maximum(0.5 * step, 1.7 * blade.texture), 3.0 * noise)
    slope, shift = np.empty((2, len(low)))
    lines_before(change, places, threshold, FIRST_INWARD, INWARD_STEP, MOST_ALONG, STEEPEST, slope, shift)
    which = np.flatnonzero(np.isfinite(slope))
    size = np.hypot(1.0, slope[which])
    normal = (profile.normal[which] - profile.direction[which] * slope[which, None]) / size[:, None]
    return normal, (profile.rho[which] + shift[which]) / size


def _steps_before(profile: Profiles, blade: Blade, smooth: Image, low: Array, high: Array) -> tuple[Array, Array]:
    """Steps (k, places, samples) in grey levels at samples inward of each line, zero farther in than its outermost
    dots, and the places (k, places) along it."""
    places = low[:, None] + (high - low)[:, None] * INWARD_SHARES
    last = len(blade.dots) - 1
    across = outermost(blade.dots, profile.normal, last - round(WITHIN * last))
    change = np.empty((len(low), INWARD_PLACES, INWARD_SAMPLES - 2))
    depth = profile.rho - across - 3
    steps_before(smooth, profile.normal, profile.rho, places, depth, FIRST_INWARD, INWARD_STEP, change)
    return change, places


def parallax(profile: Profiles, other: OtherEye, beside: NDArray[np.bool_], noise: float) -> Array:
    """Share (k,) of the agreeing places whose step the other eye sees where the blade's surface puts it.

    NaN where the line's parallax against the far background is too small to tell them apart.
    """
    t = profile.t[:, ::2]
    lines, places = t.shape
    points = (profile.normal * profile.rho[:, None])[:, None] + t[..., None] * profile.direction[:, None]
    there, deeper, far = other.shows(points.reshape(-1, 2)).reshape(3, lines, places, 2)
    share = np.empty(lines)
    shares_at_depth(
        other.smooth, there, deeper, far, profile.normal, profile.step, profile.agrees, beside, PARALLAX_PX,
        LEAST_PARALLAX_PX, PARALLAX_STEP, 1.2 * noise, LEAST_PLACES, PARALLAX_SAMPLES, share,
    )  # fmt: skip
    return share
