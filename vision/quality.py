"""How sharp and how bright the blade is in an image."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Candidate
from vision.capture import Image
from vision.lines import sampled

Array = NDArray[Any]  # of floats

SHARPEST = 0.55  # of a step's height, gained within one pixel of a sharp image at working size


def exposure(image: Image, pixels: Array) -> float:
    """Mean grey of a laser-off image at pixels (n, 2), 0 to 255."""
    if len(pixels) == 0:
        return 0.0
    at = np.rint(pixels).astype(int)
    height, width = image.shape[:2]
    return float(image[np.clip(at[:, 1], 0, height - 1), np.clip(at[:, 0], 0, width - 1)].mean())


def sharpness(image: Image, edges: tuple[Candidate, ...]) -> float:
    """0 (blurred) to 1: how steep the edges are, against their height. 0 without an edge to judge by."""
    best = 0.0
    height, width = image.shape[:2]
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    across = np.arange(-7.0, 8.0)
    for edge in edges:
        profile, k = edge.profile, edge.index
        places = profile.t[k][profile.agrees[k]][::3]
        offset = profile.offset[k][profile.agrees[k]][::3]
        if len(places) < 4:
            continue
        points = edge.outward * edge.rho + places[:, None] * profile.direction[k] + centre
        points = points + offset[:, None] * edge.outward
        u, v = points[:, :1] + across * edge.outward[0], points[:, 1:] + across * edge.outward[1]
        values = sampled(image, u, v)
        rises = np.abs(values[:, -4:].mean(axis=(0, 1)) - values[:, :4].mean(axis=(0, 1)))
        values = values[..., int(np.argmax(rises))]
        sign = np.sign(values[:, -4:].mean(axis=1) - values[:, :4].mean(axis=1))
        mean = (values * sign[:, None]).mean(axis=0)
        rise = float(mean[-4:].mean() - mean[:4].mean())
        if rise > 2:
            best = max(best, float(np.diff(mean).max()) / rise)
    return min(best / SHARPEST, 1.0)
