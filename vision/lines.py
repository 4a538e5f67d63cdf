"""Straight steps of brightness: candidates by a gradient-directed Hough transform, refined on profiles across each
line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image

Array = NDArray[Any]  # of floats

ANGLES = 60  # bins of 3° modulo 180°
SPREAD = 1  # bins to each side that a pixel votes for: its gradient's direction is no better known
MOST_PIXELS = 6000  # edge pixels that vote, the strongest
RHO_STEP = 2.0  # px of the half-size image
REACH = 7  # px across a candidate line within which its step is looked for
SAMPLES = 96  # profiles along a candidate line
FOCUS_PX = 160.0  # standard deviation of the weight about the place where a bending edge is to be right
SLOPE_HELD, BEND_HELD = 0.05, 1e-4  # what a fit of few steps is held to: slope, and change of slope per px over two


def sensor_noise(tones: Image) -> float:
    """Standard deviation of the noise in grey levels, from what neighbours do not share in the quiet half of the
    image."""
    part = tones[1::4, :, 0]
    rough = part[:, 1:-1:7].astype(np.int16) * 2 - part[:, :-2:7] - part[:, 2::7]
    return max(0.6, 1.4826 * float(np.median(np.abs(rough))) / float(np.sqrt(6.0)))


@dataclass(frozen=True)
class Gradients:
    """Edge pixels of the half-size image: position (n, 2) in px of the working image's frame, direction, weight ≤ 1."""

    position: Array
    angle: Array
    weight: Array


def edge_pixels(tones: Image, noise: float) -> Gradients:
    """Pixels whose brightness changes by more than noise."""
    half = cv2.resize(tones, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    half = cv2.blur(half, (3, 3))
    planes = [half] if half.ndim == 2 else list(cv2.split(half))
    dx, dy, strength = _sobel(planes[0])
    for plane in planes[1:]:
        other_dx, other_dy, other = _sobel(plane)
        stronger = cv2.compare(other, strength, cv2.CMP_GT)
        cv2.copyTo(other_dx, stronger, dx)
        cv2.copyTo(other_dy, stronger, dy)
        cv2.max(other, strength, strength)
    ridge = _ridge(dx, dy, strength)
    v, u = np.nonzero(ridge[2:-2, 2:-2] > max(2.0, 1.4 * noise))
    v, u = v + 2, u + 2
    level = strength[v, u]
    threshold = max(2.0, 1.4 * noise)
    if len(u) > MOST_PIXELS:
        threshold = max(threshold, float(np.partition(level, -MOST_PIXELS)[-MOST_PIXELS]))
        keep = level >= threshold
        v, u = v[keep], u[keep]
    gx, gy = dx[v, u].astype(np.float32), dy[v, u].astype(np.float32)
    weight = np.minimum(np.hypot(gx, gy) / (10 * threshold), 1.0)
    centre = (np.array(tones.shape[1::-1]) - 1) / 2
    position = np.column_stack([u, v]) * 2 + 0.5 - centre
    return Gradients(position, np.arctan2(gy, gx), weight)


def _sobel(plane: Image) -> tuple[NDArray[np.int16], NDArray[np.int16], Image]:
    dx, dy = cv2.Sobel(plane, cv2.CV_16S, 1, 0), cv2.Sobel(plane, cv2.CV_16S, 0, 1)
    strength = cv2.addWeighted(cv2.convertScaleAbs(dx), 0.5, cv2.convertScaleAbs(dy), 0.5, 0)
    return dx, dy, strength


def _ridge(dx: NDArray[np.int16], dy: NDArray[np.int16], strength: Image) -> Image:
    """The strength where it is greatest across the step, zero elsewhere."""
    upright = cv2.compare(cv2.convertScaleAbs(dx), cv2.convertScaleAbs(dy), cv2.CMP_GE)
    highest = cv2.dilate(strength, np.ones((3, 1), np.uint8))
    cv2.copyTo(cv2.dilate(strength, np.ones((1, 3), np.uint8)), upright, highest)
    return np.asarray(cv2.copyTo(strength, cv2.compare(strength, highest, cv2.CMP_EQ)), np.uint8)


def smoothed(tones: Image) -> Image:
    """A 3 × 3 mean of tones (h, w, c), of the same shape."""
    return np.asarray(cv2.blur(tones, (3, 3)), np.uint8).reshape(tones.shape)


def sampled(image: Image, u: Array, v: Array) -> NDArray[np.float32]:
    """Bilinear values (…, c) of an image (h, w, c) at pixels u, v (…); the border continues outward."""
    flat = (-1, u.shape[-1])
    values = cv2.remap(
        image,
        u.reshape(flat).astype(np.float32),
        v.reshape(flat).astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(values.reshape(*u.shape, -1), np.float32)


def steps(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Central differences (…, n - 2) along the last but one axis of values (…, n, c): of the tone that changes most."""
    change = values[..., 2:, :] - values[..., :-2, :]
    if change.shape[-1] == 1:
        return change[..., 0]
    first, second = change[..., 0], change[..., 1]
    return np.where(np.abs(first) >= np.abs(second), first, second)


def hough_lines(pixels: Gradients, most: int, size: tuple[int, int]) -> tuple[Array, Array]:
    """(theta, rho) (k, 2) with theta in [0, π) and signed rho in working px, and votes (k,), the strongest first.

    size: (width, height) of the working image.
    """
    reach = np.hypot(*size) / 4  # of the half-size image
    bins = int(2 * reach / RHO_STEP) + 3
    own = np.floor((pixels.angle % np.pi) / np.pi * ANGLES).astype(np.int64) % ANGLES
    theta = (np.arange(ANGLES) + 0.5) * np.pi / ANGLES
    cosine, sine = np.cos(theta), np.sin(theta)
    x, y = pixels.position[:, 0] / 2, pixels.position[:, 1] / 2
    votes = np.zeros(ANGLES * bins)
    for step in range(-SPREAD, SPREAD + 1):
        angle = (own + step) % ANGLES
        rho = x * cosine[angle] + y * sine[angle]
        place = np.rint((rho + reach) / RHO_STEP).astype(np.int64) + 1
        votes += np.bincount(angle * bins + place, pixels.weight, votes.size)[: votes.size]
    table = votes.reshape(ANGLES, bins).astype(np.float32)
    wrapped = np.vstack([table[-2:, ::-1], table, table[:2, ::-1]])
    wrapped = cv2.blur(wrapped, (3, 1))
    highest = cv2.dilate(wrapped, np.ones((3, 5), np.uint8))
    peaks = (wrapped == highest)[2:-2] & (wrapped[2:-2] > 4)
    a, r = np.nonzero(peaks)
    strength = wrapped[2:-2][a, r].astype(float)
    order = np.argsort(-strength, kind="stable")[:most]
    rho = ((r[order] - 1) * RHO_STEP - reach) * 2
    return np.column_stack([theta[a[order]], rho]), strength[order]


@dataclass(frozen=True)
class Profiles:
    """K lines, each sampled at m places: refined normals (k, 2), rho (k,) signed along them (image frame, px), places
    `t` (k, m) along the direction (normal turned by +90°), offset (k, m) px of the step from the refined line, signed
    step (k, m) in grey levels along the normal, and `agrees` (k, m): the step is real and lies on the line. The line
    is the tangent at `focus` (k,) of an edge whose slope changes by `bend` (k,) per px; offsets are from that curve."""

    normal: Array
    rho: Array
    t: Array
    offset: Array
    step: Array
    agrees: NDArray[np.bool_]
    slope_sigma: Array
    rho_sigma: Array
    bend: Array
    focus: Array

    def take(self, which: NDArray[np.int64]) -> Profiles:
        """Some of the lines."""
        return Profiles(*(value[which] for value in vars(self).values()))

    @property
    def direction(self) -> Array:
        """Unit directions (k, 2)."""
        return np.column_stack([-self.normal[:, 1], self.normal[:, 0]])


def visible_stretch(normal: Array, rho: Array, half: Array) -> tuple[Array, Array]:
    """First and last place (k,) along each line inside the image of half extents `half` (2,); equal where it misses
    it."""
    direction = np.column_stack([-normal[:, 1], normal[:, 0]])
    foot = normal * rho[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (-half - foot) / direction, (half - foot) / direction
    first, last = np.fmin(one, two), np.fmax(one, two)
    outside = (np.abs(direction) < 1e-9) & (np.abs(foot) > half)
    start = np.nanmax(np.where(np.isfinite(first), first, -np.inf), axis=1)
    end = np.nanmin(np.where(np.isfinite(last), last, np.inf), axis=1)
    return start, np.where(outside.any(axis=1), start, np.maximum(end, start))


def refine_lines(
    smooth: Image,
    normal: Array,
    rho: Array,
    noise: float,
    focus: Array,
    reach: int = REACH,
    slopes_deg: float = 2.0,
    samples: int = SAMPLES,
) -> Profiles:
    """Lines fitted to the steepest steps across each of K candidate lines, robustly.

    smooth: the tones (h, w, c) after a 3 × 3 mean. normal (k, 2), rho (k,) in the image frame. focus (k,): the place
    along each line around which it is to be right, where the edge bends.
    """
    height, width = smooth.shape[:2]
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    start, end = visible_stretch(normal, rho, centre - 3)
    share = np.linspace(0, 1, samples)
    t = start[:, None] + (end - start)[:, None] * share
    direction = np.column_stack([-normal[:, 1], normal[:, 0]])
    across = np.arange(-reach - 1, reach + 2, dtype=float)
    base = (
        (rho[:, None, None] + across) * normal[:, 0, None, None],
        (rho[:, None, None] + across) * normal[:, 1, None, None],
    )
    u = base[0] + t[..., None] * direction[:, 0, None, None] + centre[0]
    v = base[1] + t[..., None] * direction[:, 1, None, None] + centre[1]
    raw = steps(sampled(smooth, u, v))
    gradient: Array = (raw + 0.5 * (np.roll(raw, 1, 1) + np.roll(raw, -1, 1))) / 2
    size = np.abs(gradient)
    best = np.argmax(size[..., 1:-1], axis=-1) + 1
    before, peak, after = (np.take_along_axis(size, (best + k)[..., None], -1)[..., 0] for k in (-1, 0, 1))
    bend = before - 2 * peak + after
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(bend < 0, 0.5 * (before - after) / bend, 0.0)
    offset = across[1:-1][best] + np.clip(fraction, -0.5, 0.5)
    step = np.take_along_axis(gradient, best[..., None], -1)[..., 0]
    real = peak > max(1.2, 1.4 * noise)
    place = t - focus[:, None]
    slope, shift = _vote_slope(place, offset, real, slopes_deg)
    fit = np.stack([shift, slope, np.zeros_like(slope)], axis=1)
    near = np.exp(-0.5 * (place / FOCUS_PX) ** 2)
    design = np.stack([np.ones_like(place), place, place * place], axis=2)
    for tolerance in (2.0, 1.2, 1.0, 1.0):
        residual = offset - (design @ fit[..., None])[..., 0]
        weight = real * near / (1 + (residual / tolerance) ** 2) ** 2
        fit, information = _weighted_curve(design, offset, weight, fit)
    residual = offset - (design @ fit[..., None])[..., 0]
    agrees = real & (np.abs(residual) < 1.5)
    turn = np.arctan(fit[:, 1])
    new_normal = np.column_stack(
        [
            normal[:, 0] * np.cos(turn) - direction[:, 0] * np.sin(turn),
            normal[:, 1] * np.cos(turn) - direction[:, 1] * np.sin(turn),
        ]
    )
    point = normal * (rho + fit[:, 0])[:, None] + direction * focus[:, None]
    new_rho = (new_normal * point).sum(axis=1)
    used = agrees * near
    scatter2 = (residual**2 * used).sum(axis=1) / np.maximum(used.sum(axis=1), 1) + 0.01
    # Neighbouring profiles share pixels: three of them count as one.
    covariance = np.linalg.inv(information) * (2 * scatter2)[:, None, None]
    slope_sigma = np.sqrt(covariance[:, 1, 1])
    rho_sigma = np.sqrt(covariance[:, 0, 0] + 0.04**2)
    bend_px = 2 * fit[:, 2]
    return Profiles(new_normal, new_rho, t, residual, step, agrees, slope_sigma, rho_sigma, bend_px, focus)


def _vote_slope(t: Array, offset: Array, real: NDArray[np.bool_], slopes_deg: float) -> tuple[Array, Array]:
    """Slope and offset (k,) on which most of the steps lie, by trying slopes and counting offsets."""
    slopes = np.tan(np.deg2rad(np.linspace(-slopes_deg, slopes_deg, 13)))
    bins = 40
    lines = len(t)
    index = np.arange(lines)[:, None]
    best = np.full(lines, -1.0)
    slope, shift = np.zeros(lines), np.zeros(lines)
    near = real * np.exp(-0.5 * (t / 120) ** 2)
    for tried in slopes:
        place = np.clip(np.rint(offset - tried * t), -bins // 2 + 1, bins // 2 - 1).astype(np.int64) + bins // 2
        counts: Array = np.bincount((index * bins + place).ravel(), near.ravel(), lines * bins).reshape(lines, bins)
        counts[:, 1:-1] += 0.6 * (counts[:, :-2] + counts[:, 2:])
        counts[:, [0, 1, -2, -1]] = 0
        top = counts.argmax(axis=1)
        value = counts[np.arange(lines), top] - 1e-3 * abs(tried)
        better = value > best
        best[better], slope[better], shift[better] = value[better], tried, (top - bins // 2)[better]
    return slope, shift


def _weighted_curve(design: Array, offset: Array, weight: Array, before: Array) -> tuple[Array, Array]:
    """Offset, slope and bend (k, 3) by weighted least squares, held straight where little speaks for a bend."""
    held = np.diag([1e-4, 1e-4 / SLOPE_HELD**2, 1.0 / BEND_HELD**2])
    weighted = design * weight[..., None]
    information = np.einsum("kmi,kmj->kij", weighted, design) + held
    fit = np.linalg.solve(information, np.einsum("kmi,km->ki", weighted, offset)[..., None])[..., 0]
    good = (weight.sum(axis=1) > 2)[:, None]
    return np.where(good, fit, before), information
