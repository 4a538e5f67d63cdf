"""Following a blade's edge: one estimate and one pose in, one position/yaw setpoint and gimbal angles out.

The setpoint is a carrot: PX4's position controller flies at its gain (0.95 a second) times the distance to it, without
feed-forward, so that a carrot a speed over that gain ahead, along the blade, is followed at that speed. Across the
blade it stands where the wanted edge has the least room ρ_min to the image border (5.16), or where both edges fit with
as much, in the middle between them; along the surface's normal, where the *nearest* point of the blade is at the
standoff.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flight.autopilot import Setpoint, VehiclePose
from flight.guidance.angles import difference, nearer_direction, wrap
from flight.guidance.heading import heading_on_both, heading_on_one, heading_on_wrong_side, turn_of
from flight.guidance.pid import Pid, PidState
from flight.guidance.pointing import angles_of, pd_angles
from flight.guidance.rooms import View
from vision.capture import rotation_of
from vision.estimate import BladeEstimate, BladeFrame, SideEstimate

__all__ = ["FollowCommand", "FollowSettings", "FollowState", "View", "follow"]

Array = NDArray[np.float64]
Side = Literal["leading", "trailing"]
Mode = Literal["both", "one", "wrong_side", "none"]

STANDOFF_PID = Pid(p=2.0, i=0.15, d=0.5, limit=1.5, integral_limit=0.4)
LONGEST_TICK_S = 0.5  # mission; after a blocked loop nothing is made up for at once
SLOW_M_S = 0.2  # below this the speed is not regulated: the vehicle is to stand
SPEED_PID = Pid(p=0.0, i=0.25, integral_limit=0.3)


@dataclass(frozen=True)
class FollowSettings:
    """frame: the one that the estimate's stations and offsets are in. heading rad: the turbine's. mount (3,) m: the
    left lens in body axes. speed_m_s 0 holds the station. k: least room between edge and image border as a share
    (5.16).

    position_gain: of the autopilot's position controller, a second. An edge unseen for longer than `edge_bridge_s`
    does not count. The camera turns at most `aim_limit` rad from the surface's normal to keep its fixation point, the
    body at most `yaw_limit` from the turbine's heading, at `yaw_rate` rad/s.
    """

    frame: BladeFrame
    view: View
    mount: Array
    heading: float
    side: Side = "leading"
    toward: Literal["tip", "root"] = "tip"
    standoff_m: float = 3.0
    speed_m_s: float = 0.8
    k: float = 0.25
    position_gain: float = 0.95
    edge_bridge_s: float = 6.0
    acceleration_m_s2: float = 0.4
    aim_limit: float = np.deg2rad(8.0)
    yaw_limit: float = np.deg2rad(25.0)
    yaw_rate: float = np.deg2rad(12.0)
    standoff: Pid = STANDOFF_PID
    speed: Pid = SPEED_PID
    cross_gain: float = 1.2
    gimbal_p: float = 1.0
    gimbal_d: float = 0.05


@dataclass(frozen=True)
class FollowState:
    """What the controllers remember from one tick to the next; begin with `FollowState()`."""

    stamp_s: float | None = None
    standoff: PidState = field(default_factory=PidState)
    speed_m_s: float = 0.0
    speed: PidState = field(default_factory=PidState)
    yaw: float | None = None
    aim_error: tuple[float, float] | None = None


@dataclass(frozen=True)
class FollowCommand:
    """setpoint: local NED. gimbal_yaw from north, gimbal_pitch from the horizon, rad. heading_image: direction of
    travel in the image by 5.14 to 5.22, rad, NaN without an edge. mode: what there was to go by. cross_error_m: the
    way across the blade to where the edge has its room; standoff_error_m: nearest distance less the standoff;
    speed_m_s: along the blade in the direction of travel, as measured now. state: for the next call."""

    setpoint: Setpoint
    gimbal_yaw: float
    gimbal_pitch: float
    heading_image: float
    mode: Mode
    cross_error_m: float = 0.0
    standoff_error_m: float = 0.0
    speed_m_s: float = 0.0
    state: FollowState = field(default_factory=FollowState)


@dataclass(frozen=True)
class _Aim:
    """Where on the blade to look: offset and slope of the fixation line in blade coordinates, and what it rests on."""

    offset_m: float
    slope: float
    mode: Mode


def follow(estimate: BladeEstimate, pose: VehiclePose, settings: FollowSettings, state: FollowState) -> FollowCommand:
    """The command for this instant; call it at every control tick with the state of the last one.

    Without an edge of the wanted side (mode 'none') it stays at its station and moves gently toward where the edge was
    last known, or toward the wanted side of the blade.
    """
    elapsed = 0.0 if state.stamp_s is None else min(max(0.0, pose.stamp_s - state.stamp_s), LONGEST_TICK_S)
    lens = pose.position + rotation_of(*pose.attitude) @ settings.mount
    normal = estimate.normal
    foot = lens - float((lens - estimate.point) @ normal) * normal
    station, offset, _ = (float(v) for v in settings.frame.to_blade(foot))

    aim = _aim(estimate, settings, station, offset, normal)
    travel = 1.0 if settings.toward == "tip" else -1.0
    along = _on_surface(settings.frame.span + aim.slope * settings.frame.across, normal) * travel
    outward = _on_surface(settings.frame.across - float(settings.frame.across @ along) * along, normal)

    cross_error = aim.offset_m - offset
    if aim.mode == "none":
        cross_error = float(np.clip(cross_error, -0.3, 0.3))
    centred = float(np.clip(1.5 - abs(cross_error) / 0.5, 0.0, 1.0))
    wanted_speed = 0.0 if aim.mode == "none" else settings.speed_m_s * centred
    step = settings.acceleration_m_s2 * elapsed
    speed = state.speed_m_s + float(np.clip(wanted_speed - state.speed_m_s, -2 * step, step))

    measured_speed = float(pose.velocity @ along)
    # The autopilot's gain is not exactly known, and a setpoint is a little old when it is flown: the integral makes up.
    memory = state.speed if speed > SLOW_M_S else PidState()
    trim, speed_state = settings.speed.step(speed - measured_speed, elapsed if speed > SLOW_M_S else 0.0, memory)

    standoff_error = estimate.nearest_m - settings.standoff_m
    approach, standoff_state = settings.standoff.step(
        standoff_error, elapsed, state.standoff, error_rate=float(pose.velocity @ normal)
    )
    target = (
        pose.position
        + (speed + trim) / settings.position_gain * along
        + settings.cross_gain * cross_error * outward
        - approach * normal
    )

    facing = _facing(normal, settings)
    yaw = facing if state.yaw is None else state.yaw
    turn = settings.yaw_rate * elapsed
    yaw = wrap(yaw + float(np.clip(difference(facing, yaw), -turn, turn)))

    fixation = settings.frame.to_blade(foot)
    fixation = settings.frame.to_ned(fixation + np.array([0.0, cross_error, estimate.across_slope * cross_error]))
    reference = _aim_angles(fixation - lens, normal, settings.aim_limit)
    measured = float(pose.gimbal[0]), float(pose.gimbal[1])
    if not np.all(np.isfinite(measured)):
        measured = reference
    (gimbal_yaw, gimbal_pitch), error = pd_angles(
        reference, measured, state.aim_error, elapsed, settings.gimbal_p, settings.gimbal_d
    )
    return FollowCommand(
        setpoint=Setpoint(target, yaw),
        gimbal_yaw=gimbal_yaw,
        gimbal_pitch=gimbal_pitch,
        heading_image=_heading_image(estimate, settings, aim.mode),
        mode=aim.mode,
        cross_error_m=cross_error,
        standoff_error_m=standoff_error,
        speed_m_s=measured_speed,
        state=FollowState(pose.stamp_s, standoff_state, speed, speed_state, yaw, error),
    )


def _aim(estimate: BladeEstimate, settings: FollowSettings, station: float, offset: float, normal: Array) -> _Aim:
    """The fixation line: as far inside the wanted edge as its room demands, or midway where both edges have theirs."""
    sign = 1.0 if settings.side == "leading" else -1.0
    wanted, other = estimate.leading, estimate.trailing
    if settings.side == "trailing":
        wanted, other = other, wanted
    room = _inset(settings, estimate, normal)
    known = {"wanted": _usable(wanted, settings), "other": _usable(other, settings)}
    away = station - estimate.station_m
    if wanted is None or not known["wanted"]:
        if wanted is not None:
            target, slope = wanted.offset_m + wanted.slope * away - sign * room, wanted.slope
        elif other is not None and known["other"]:
            target, slope = other.offset_m + other.slope * away + sign * room, other.slope
        else:
            target, slope = offset, 0.0
        return _Aim(target, slope, "none")
    edge = wanted.offset_m + wanted.slope * away
    mode: Mode = "one"
    inset, inset_slope = room, 0.0
    if other is not None and known["other"]:
        half = sign * (edge - other.offset_m - other.slope * away) / 2
        if half <= room:
            mode, inset, inset_slope = "both", max(half, 0.0), sign * (wanted.slope - other.slope) / 2
    if _beyond(wanted) or sign * (offset - edge) > 0:
        mode = "wrong_side"
    return _Aim(edge - sign * inset, wanted.slope - sign * inset_slope, mode)


def _usable(side: SideEstimate | None, settings: FollowSettings) -> bool:
    return side is not None and side.age_s <= settings.edge_bridge_s


def _beyond(side: SideEstimate) -> bool:
    """Whether the optical axis passes the edge on its far side, over the background."""
    if side.line is None or side.outward is None:
        return False
    return float(side.outward @ (np.cos(side.line.theta), np.sin(side.line.theta))) < 0


def _inset(settings: FollowSettings, estimate: BladeEstimate, normal: Array) -> float:
    """Metres from the wanted edge inward to the image centre when the edge has exactly its least room (5.15, 5.16)."""
    camera = rotation_of(0.0, *reversed(angles_of(-normal)))
    across = settings.frame.across @ camera
    theta = float(np.arctan2(across[2], across[1]))
    return (1.0 - settings.k) * settings.view.reach(theta) * settings.standoff_m / settings.view.focal_px


def _on_surface(direction: Array, normal: Array) -> Array:
    flat = direction - float(direction @ normal) * normal
    result: Array = flat / np.linalg.norm(flat)
    return result


def _facing(normal: Array, settings: FollowSettings) -> float:
    """Yaw that faces the surface, within `yaw_limit` of the turbine's heading (5.3)."""
    yaw, _ = angles_of(-normal)
    off = float(np.clip(difference(yaw, settings.heading), -settings.yaw_limit, settings.yaw_limit))
    return wrap(settings.heading + off)


def _aim_angles(sight: Array, normal: Array, limit: float) -> tuple[float, float]:
    """Gimbal angles along the normal, turned toward the line of sight to the fixation point by at most `limit`."""
    straight = angles_of(-normal)
    wanted = angles_of(sight)
    yaw = float(np.clip(difference(wanted[0], straight[0]), -limit, limit))
    pitch = float(np.clip(wanted[1] - straight[1], -limit, limit))
    return wrap(straight[0] + yaw), straight[1] + pitch


def _heading_image(estimate: BladeEstimate, settings: FollowSettings, mode: Mode) -> float:
    """Direction of travel in the image by the thesis's rules, from the lines as the camera sees them now."""
    reverse = settings.toward == "root"
    wanted, other = estimate.leading, estimate.trailing
    if settings.side == "trailing":
        wanted, other = other, wanted
    if mode == "none" or wanted is None or wanted.line is None:
        return nan
    if mode == "both" and other is not None and other.line is not None:
        ahead = [
            nearer_direction(side.line.theta + np.pi / 2, estimate.heading) for side in (wanted, other) if side.line
        ]
        return heading_on_both((ahead[0], ahead[1]), reverse)
    along = estimate.heading + (np.pi if reverse else 0.0)
    theta, rho = wanted.line.theta, wanted.line.rho
    if _beyond(wanted):
        return heading_on_wrong_side(settings.view, theta, rho, settings.k, turn_of(theta + np.pi, along))
    return heading_on_one(settings.view, theta, rho, settings.k, turn_of(theta, along))
