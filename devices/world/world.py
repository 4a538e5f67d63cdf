"""The simulated world: the true turbine, its settings, which faults are on, and what a range finder meets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from devices.world.faults import FaultSchedule
from devices.world.settings import WorldSettings
from devices.world.turbine import TurbineShape
from vision.capture import rotation_of

if TYPE_CHECKING:
    from devices.world.renderer import Renderer

Array = NDArray[np.float64]

RANGE_REACH_M = 40.0
RANGE_CONE_RAD = np.deg2rad(1.5)


class Carrier(Protocol):
    """What a rig must know of the vehicle that carries it, as in `TruePose`. It may also have a `stamp_s`."""

    @property
    def position(self) -> Array: ...

    @property
    def attitude(self) -> Array: ...

    @property
    def gimbal(self) -> Array: ...

    @property
    def velocity(self) -> Array | None: ...


@dataclass(frozen=True)
class TruePose:
    """Where the vehicle truly is: position (3,) m in local NED, attitude (3,) roll, pitch, yaw rad, gimbal (2,) yaw
    from north and pitch up from the horizon, rad. velocity (3,) m/s, for the motion between two exposures, and stamp_s
    on the executive's clock where the source knows them."""

    position: Array
    attitude: Array
    gimbal: Array
    velocity: Array | None = None
    stamp_s: float | None = None


class World:
    """One turbine under one setting. A process that needs no images (the simulated vehicle) pays for no renderer."""

    def __init__(self, shape: TurbineShape, settings: WorldSettings, seed: int | None = None) -> None:
        self.shape = shape
        self.settings = settings if seed is None else settings.model_copy(update={"seed": seed})
        self.faults = FaultSchedule(settings.faults)

    @cached_property
    def renderer(self) -> Renderer:
        """Draws the images; made when first asked for (a second or two)."""
        from devices.world.renderer import Renderer

        return Renderer(self.shape, self.settings)

    def enter_state(self, path: str, now_s: float) -> None:
        """The mission entered a state: faults that wait for it begin to count."""
        self.faults.enter_state(path, now_s)

    def forward_range(self, position: Array, attitude: Array) -> float | None:
        """Distance in metres that a forward range finder at a position (3,) and attitude (3,) measures; None beyond
        its reach.

        The nearest of five rays within its cone, against the turbine and level ground.
        """
        from devices.world.raycast import cast

        tilt = np.tan(RANGE_CONE_RAD)
        rays = np.array([[1.0, 0, 0], [1, tilt, 0], [1, -tilt, 0], [1, 0, tilt], [1, 0, -tilt]])
        rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ rotation_of(*attitude).T
        above = max(-self.shape.ground_m - float(position[2]), 0.0)
        with np.errstate(divide="ignore"):
            ground = np.where(rays[:, 2] > 1e-6, above / np.maximum(rays[:, 2], 1e-6), np.inf)
        distance, _ = cast(self.shape.mesh, np.asarray(position, float), rays, np.minimum(ground, RANGE_REACH_M))
        nearest = float(distance.min())
        return nearest if nearest < RANGE_REACH_M else None
