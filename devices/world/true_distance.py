"""How far the blade truly was along the optical axis, for holding the tracker's claims against it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from devices.world.raycast import cast
from devices.world.truth import Flight
from devices.world.turbine import BLADES, TurbineShape

Array = NDArray[np.float64]
REACH_M = 40.0


def distances_ahead(flight: Flight, shape: TurbineShape, mount: Array, stamps: Sequence[float]) -> Array:
    """Distances (n,) in metres from the left lens along its true optical axis to the turbine at mission times, NaN
    where what it meets first is no blade, or nothing, or where the record does not reach."""
    if len(stamps) == 0:
        return np.empty(0)
    poses = [flight.camera(stamp, mount) for stamp in stamps]
    places, axes = np.array([pose.position for pose in poses]), np.array([pose.rotation[:, 0] for pose in poses])
    distance, hit = cast(shape.mesh, places, axes, REACH_M)
    blade = (hit >= 0) & np.isin(shape.mesh.part[np.maximum(hit, 0)], BLADES)
    known = (np.asarray(stamps) >= flight.t[0]) & (np.asarray(stamps) <= flight.t[-1])
    result: Array = np.where(blade & known, distance, np.nan)
    return result
