"""Following a blade's edge: one estimate and one pose in, one position/yaw setpoint and gimbal angles out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flight.autopilot import Setpoint, VehiclePose
from vision.estimate import BladeEstimate, BladeFrame

Array = NDArray[np.float64]
Side = Literal["leading", "trailing"]
Mode = Literal["both", "one", "wrong_side", "none"]


@dataclass(frozen=True)
class View:
    """The left camera's image: width and height in pixels, focal length in pixels."""

    width_px: float
    height_px: float
    focal_px: float


@dataclass(frozen=True)
class FollowSettings:
    """frame: the one that the estimate's stations and offsets are in. heading rad: the turbine's. mount (3,) m: the left lens
    in body axes. speed_m_s 0 holds the station. k: least room between edge and image border as a share (5.16)."""

    frame: BladeFrame
    view: View
    mount: Array
    heading: float
    side: Side = "leading"
    toward: Literal["tip", "root"] = "tip"
    standoff_m: float = 3.0
    speed_m_s: float = 0.8
    k: float = 0.25


@dataclass(frozen=True)
class FollowState:
    """What the controllers remember from one tick to the next; begin with `FollowState()`."""

    stamp_s: float | None = None


@dataclass(frozen=True)
class FollowCommand:
    """setpoint: local NED. gimbal_yaw from north, gimbal_pitch from the horizon, rad. heading_image: direction of travel in
    the image by 5.14 to 5.22, rad, NaN without an edge. mode: what there was to go by. cross_error_m, standoff_error_m,
    speed_m_s: as measured now. state: for the next call."""

    setpoint: Setpoint
    gimbal_yaw: float
    gimbal_pitch: float
    heading_image: float
    mode: Mode
    cross_error_m: float = 0.0
    standoff_error_m: float = 0.0
    speed_m_s: float = 0.0
    state: FollowState = field(default_factory=FollowState)


def follow(estimate: BladeEstimate, pose: VehiclePose, settings: FollowSettings, state: FollowState) -> FollowCommand:
    """The command for this instant; call it at every control tick with the state of the last one."""
    raise NotImplementedError
