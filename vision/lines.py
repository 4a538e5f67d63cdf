"""Straight steps of brightness: candidates by a gradient-directed Hough transform, refined on profiles across each
line."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.gradient_kernels import SUM, gradients, line_peaks, line_votes, median_roughness, ridge
from vision.profile_kernels import refine, stretches
from vision.workspace import lent

Array = NDArray[Any]  # of floats

ANGLES = 60  # bins of 3° modulo 180°
SPREAD = 1  # bins to each side that a pixel votes for: its gradient's direction is no better known
MOST_PIXELS = 6000  # edge pixels that vote, the strongest
RHO_STEP = 4.0  # px
LEAST_VOTES = 4.0  # of the strongest pixels, for a line
REACH = 7  # px across a candidate line within which its step is looked for
SAMPLES = 96  # profiles along a candidate line
MARGIN = 3.0  # px along the image border in which no steps are sought


def sensor_noise(tones: Image) -> float:
    """Standard deviation of the noise in grey levels, from what neighbours do not share in the quiet half of the
    image."""
    return max(0.6, 1.4826 * float(median_roughness(np.ascontiguousarray(tones))) / float(np.sqrt(6.0)))


def smoothed(tones: Image, room: Image | None = None) -> Image:
    """A 3 × 3 mean of tones (h, w, c), of the same shape; room: where to write it."""
    return np.asarray(cv2.blur(tones, (3, 3), room), np.uint8).reshape(tones.shape)


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


def hough_lines(tones: Image, noise: float, most: int) -> Array:
    """(theta, rho) (k, 2) of the lines that most steps lie on, of those that exceed the noise; with theta in [0, π) and
    signed rho in px of the image frame of tones (h, w, c), the strongest first."""
    size = (tones.shape[0] // 2, tones.shape[1] // 2)
    dx, dy = lent("dx", size, np.int16), lent("dy", size, np.int16)
    strength = lent("strength", size, np.uint16)
    gradients(np.ascontiguousarray(tones), dx, dy, strength)
    pixels = ridge(dx, dy, strength, round(2 * SUM * max(2.0, 1.4 * noise)), MOST_PIXELS)
    reach = float(np.hypot(*tones.shape[:2])) / 2
    table = np.empty((ANGLES, int(2 * reach / RHO_STEP) + 3), np.float32)
    first = (0.5 - (tones.shape[1] - 1) / 2, 0.5 - (tones.shape[0] - 1) / 2)
    line_votes(pixels, first, SPREAD, reach, RHO_STEP, table)
    angle, place = np.empty((2, table.size // 4), np.int64)
    strength = np.empty(table.size // 4)
    count = line_peaks(table, LEAST_VOTES, angle, place, strength)
    order = np.argsort(-strength[:count], kind="stable")[:most]
    lines = np.empty((len(order), 2))
    lines[:, 0] = (angle[order] + 0.5) * (np.pi / ANGLES)
    lines[:, 1] = (place[order] - 1) * RHO_STEP - reach
    return lines


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
        """Some of the lines, in their order."""
        if len(which) == len(self.rho):
            return self
        return Profiles(*(getattr(self, part.name)[which] for part in fields(self)))

    @cached_property
    def direction(self) -> Array:
        """Unit directions (k, 2)."""
        return np.column_stack([-self.normal[:, 1], self.normal[:, 0]])


def visible_stretch(normal: Array, rho: Array, half: Array) -> tuple[Array, Array]:
    """First and last place (k,) along each line inside the image of half extents `half` (2,); equal where it misses
    it."""
    start, end = np.empty((2, len(rho)))
    stretches(np.ascontiguousarray(normal, float), np.ascontiguousarray(rho, float), half, start, end)
    return start, end


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
    lines = len(rho)
    t, offset, step = np.empty((3, lines, samples))
    agrees = np.empty((lines, samples), np.bool_)
    fitted, turned = np.empty((4, lines)), np.empty((lines, 2))
    normal, rho, focus = (np.ascontiguousarray(values, float) for values in (normal, rho, focus))
    least, largest = max(1.2, 1.4 * noise), float(np.deg2rad(slopes_deg))
    refine(smooth, normal, rho, focus, MARGIN, least, reach, largest, t, offset, step, agrees, fitted, turned)
    return Profiles(turned, fitted[0], t, offset, step, agrees, fitted[2], fitted[3], fitted[1], focus)
