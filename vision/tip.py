"""The blade's tip as it is reported."""

from __future__ import annotations

import numpy as np

from vision.ending import Ending
from vision.observation import Line, Tip


def tip_of(ending: Ending, factor: float) -> Tip:
    """The end of a blade as a tip in pixels of the full image."""
    across = np.array([-ending.toward[1], ending.toward[0]])
    point = ending.station * ending.toward + ending.lane * across
    normal, rho = ending.toward, ending.station
    if rho < 0:
        normal, rho = -normal, -rho
    return Tip(Line(float(np.arctan2(normal[1], normal[0])), rho * factor), point * factor, ending.sigma_px * factor)
