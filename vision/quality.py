"""How sharp and how bright the blade is in an image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.candidates import Candidate

Array = NDArray[np.float64]

SHARPEST = 0.55  # of a step's height, gained within one pixel of a sharp image at working size


def exposure(grey: Image, pixels: Array) -> float:
    """Mean grey of a laser-off image at pixels (n, 2), 0 to 255."""
    if len(pixels) == 0:
        return 0.0
    at = np.rint(pixels).astype(int)
    height, width = grey.shape
    return float(grey[np.clip(at[:, 1], 0, height - 1), np.clip(at[:, 0], 0, width - 1)].mean())


def sharpness(grey: Image, edges: tuple[Candidate, ...]) -> float:
    """0 (blurred) to 1: how steep the edges are, against their height. 0 without an edge to judge by."""
    best = 0.0
    height, width = grey.shape
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
        u = (points[:, :1] + across * edge.outward[0]).astype(np.float32)
        v = (points[:, 1:] + across * edge.outward[1]).astype(np.float32)
        values = cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float32)
        sign = np.sign(values[:, -4:].mean(axis=1) - values[:, :4].mean(axis=1))
        mean = (values * sign[:, None]).mean(axis=0)
        rise = float(mean[-4:].mean() - mean[:4].mean())
        if rise > 2:
            best = max(best, float(np.diff(mean).max()) / rise)
    return min(best / SHARPEST, 1.0)
