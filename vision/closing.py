"""Where the blade ends in the image: a spiked tip or a closed outline, and the edges as they are behind it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.candidates import Blade, Candidate
from vision.capture import Image
from vision.edges import Found, refocused
from vision.lines import sensor_noise
from vision.tip import Outline, find_tip

Array = NDArray[Any]  # of floats

BEHIND_TIP = 0.9  # of the blade's width: so far behind the tip a round one no longer bends the edges
SPIKE_SIGMA_PX = 2.0


def close(found: Found, clean: Image, smooth: Image, blade: Blade) -> tuple[tuple[Candidate, ...], Outline | None]:
    """The edges behind the tip and the tip, None where the blade leaves the image. clean, smooth (h, w, c): working
    image free of dots, and its 3 × 3 mean."""
    edges = found.edges
    if found.spike is not None:
        apex, toward = found.spike.apex, found.spike.toward
        half = (np.array(smooth.shape[1::-1]) - 1) / 2
        if (np.abs(apex) > half - 4).any():
            return edges, None
        return edges, Outline(toward, apex, toward, float(toward @ apex), SPIKE_SIGMA_PX)
    outline = find_tip(smooth, sensor_noise(clean), edges, found.axis, blade)
    if outline is None:
        return edges, None
    toward = outline.toward
    dots = blade.dots
    across = np.array([-toward[1], toward[0]])
    tip = float(outline.point @ toward)
    wide = float(np.ptp(dots @ across)) + 20.0
    station = min(0.0, tip - BEHIND_TIP * wide)
    if station < 0.0:
        edges = refocused(edges, clean, max(station, float((dots @ toward).min())), toward)
    return edges, outline
