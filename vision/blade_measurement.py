"""What an observation in the camera says of the blade in its own frame, with the covariance of all of it together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vision.blade_lines import image_plane, straightened, stretch
from vision.blade_model import BladeModel
from vision.blade_motion import (
    ACROSS_CURVATURE,
    BLADE,
    DEPTH_CURVATURE,
    EDGE,
    EDGE_CURVATURE,
    PLANE,
    RECESS,
    SIZE,
    TREMBLE,
    TWIST,
    Side,
    alike_across_m,
    alike_m,
    curvature_sigmas,
    led_to,
    shifted,
)
from vision.camera import Camera
from vision.capture import CameraPose
from vision.estimate import BladeFrame
from vision.observation import BladeObservation, Edge
from vision.tracker_settings import TrackerSettings

Array = NDArray[np.float64]


class Noise(Protocol):
    """What is new in every frame: sigmas of the camera's angles (rad) about its axes, and the shares of what the eye
    claims of surface and edges."""

    @property
    def attitude(self) -> tuple[float, float, float]: ...

    @property
    def surface(self) -> float: ...

    @property
    def edges(self) -> float: ...


@dataclass(frozen=True)
class Measurement:
    """One linearised measurement (m,): z = H x + noise of covariance R. turning (m, 3): what an error of the camera's
    angles (rad, camera frame) does to it; surface (m, 3 or 1), edges (m, 2 each): what the errors that the eye claims,
    as independent ones of one sigma each, do. parts: name → rows, the surface first."""

    z: Array
    H: Array
    R: Array
    turning: Array
    surface: Array
    edges: Array
    parts: dict[str, slice]

    def of(self, rows: NDArray[np.int64]) -> Measurement:
        """Some rows alone."""
        seen = self.turning[rows], self.surface[rows], self.edges[rows]
        return Measurement(self.z[rows], self.H[rows], self.R[np.ix_(rows, rows)], *seen, {})

    def before(self, seconds: float, jitter_m: float, settings: TrackerSettings) -> Measurement:
        """The same, taken so long before the state's own time: the vehicle trembled otherwise then."""
        alike = float(np.exp(-seconds / settings.jitter_s))
        place = self.H[:, TREMBLE]
        H = self.H.copy()
        H[:, TREMBLE] = alike * place
        return replace(self, H=H, R=self.R + (1 - alike**2) * jitter_m**2 * place @ place.T)


def look_at(pose: CameraPose, frame: BladeFrame, model: BladeModel, largest_angle: float = np.deg2rad(65)) -> Array:
    """(station, offset, depth) where the optical axis meets the modelled surface, or, where the camera looks away from
    it, of the surface straight behind the camera along the depth axis."""
    lens = frame.to_blade(pose.position)
    axis = frame.rotation @ pose.rotation[:, 0]
    behind = lens[2] - model.depth_at(lens[0], lens[1])
    closing = axis[2] - model.mean[PLANE][1:] @ axis[:2]
    if axis[2] > np.cos(largest_angle) and closing > 0.1 and behind < 0:
        return np.asarray(lens - axis * behind / closing, float)
    return np.array([lens[0], lens[1], lens[2] - behind])


def side_of(edge: Edge, camera: Camera, pose: CameraPose, frame: BladeFrame, model: BladeModel) -> Side | None:
    """Which side of the blade an edge with this outward normal can be, None where it runs across the blade."""
    normal = frame.rotation @ pose.rotation @ image_plane(*straightened(edge, camera), camera)
    _, along, across = model.mean[PLANE]
    outward = normal[:2] + normal[2] * np.array([along, across])
    if abs(outward[1]) <= abs(outward[0]):
        return None
    return "leading" if outward[1] > 0 else "trailing"


def measure(
    observation: BladeObservation,
    edges: dict[Side, Edge],
    pose: CameraPose,
    camera: Camera,
    frame: BladeFrame,
    model: BladeModel,
    settings: TrackerSettings,
    noise: Noise,
) -> Measurement:
    """The observation's plane (or distance alone) and edges as one measurement of the model's state, linearised around
    it.

    An edge in the image is a plane through the lens; where it cuts the *modelled* surface lies the measured edge, so
    that its rows depend on the state's surface too, and on how far behind it the edge of a round blade lies. A line
    fitted to a curved edge has the edge's slope where the fitted stretch has its middle, not at the reference; the same
    holds for the plane and the dots. Errors of the camera's angles are common to all rows.
    """
    assert observation.distance_m is not None
    sides = list(edges)
    if observation.normal is not None and observation.plane_covariance is not None:
        gradient = observation.normal[1:] / -observation.normal[0]
        surface, surface_covariance = np.array([observation.distance_m, *gradient]), observation.plane_covariance
    else:
        surface = np.array([observation.distance_m])
        surface_covariance = np.array([[(observation.distance_sigma_m or 0.1) ** 2]])
    lines = np.array([straightened(edges[side], camera) for side in sides]).reshape(-1)
    seen = np.concatenate([surface, lines, np.zeros(3)])
    size = len(surface)
    claimed = [(edges[side].sigma_theta, edges[side].sigma_rho_px) for side in sides]

    camera_to_blade = frame.rotation @ pose.rotation
    lens = frame.to_blade(pose.position)
    shown = model.as_shown()
    plane = shown.mean[PLANE]
    stretches = [stretch(edges[side], camera, camera_to_blade, lens, shown) for side in sides]
    reference = np.array([model.station, model.offset])

    def in_blade_frame(seen: Array, plane: Array) -> Array:
        rotation = camera_to_blade @ small_rotation(seen[-3:])
        result = np.empty(size + 2 * len(sides))
        hit = lens + rotation[:, 0] * seen[0]
        normal = rotation @ np.array([1.0, -seen[1], -seen[2]]) if size == 3 else np.array([-plane[1], -plane[2], 1.0])
        slopes = -normal[:2] / normal[2]
        result[0] = hit[2] + slopes @ (reference - hit[:2])
        if size == 3:
            result[1:3] = slopes
        for i, (station, _) in enumerate(stretches):
            cut = rotation @ image_plane(seen[size + 2 * i], seen[size + 2 * i + 1], camera)
            lean = cut[1] + cut[2] * plane[2]
            depth = plane[0] + plane[1] * (station - model.station) - plane[2] * model.offset
            result[size + 2 * i] = (cut[1] * lens[1] - cut[0] * (station - lens[0]) - cut[2] * (depth - lens[2])) / lean
            result[size + 2 * i + 1] = -(cut[0] + cut[2] * plane[1]) / lean
        return result

    value = in_blade_frame(seen, plane)
    by_seen = jacobian(lambda p: in_blade_frame(p, plane), seen)
    by_plane = jacobian(lambda p: in_blade_frame(seen, p), plane)
    shift = shifted(model.mean)
    H = np.zeros((len(value), SIZE))
    H[:size, BLADE] = np.eye(size, 7)
    H[0, TREMBLE] = shift[0]
    spread = 0.0
    if observation.points is not None and len(observation.points) > 2:
        dots = observation.points @ camera_to_blade.T + lens
        spread = float(dots[:, 1].std())
        if size == 3:
            along, across = dots[:, :2].mean(axis=0) - reference
            slope = led_to(along, alike_m(model.station, settings))[1]
            H[1, [DEPTH_CURVATURE, TWIST]] = slope, across
            H[2, [TWIST, ACROSS_CURVATURE]] = slope, led_to(across, alike_across_m(model.station, settings))[1]
    near_root = partial(np.interp, model.station, settings.round_within_m)
    camber = curvature_sigmas(model.station, settings)[ACROSS_CURVATURE]
    bend = float(near_root(settings.surface_bend)) * camber * spread
    left_out = [np.hypot(settings.surface_sigma_m, bend * spread / 4)]
    left_out += [settings.surface_slope_sigma, np.hypot(settings.surface_slope_sigma, bend)][: size - 1]
    parts = {"surface": slice(0, size)}
    for i, side in enumerate(sides):
        rows = slice(size + 2 * i, size + 2 * i + 2)
        station, length = stretches[i]
        place, slope, _ = led_to(station - model.station, alike_m(station, settings))
        start, curvature = EDGE[side].start, EDGE_CURVATURE[side]
        H[rows, start] = 1.0, 0.0
        H[rows, start + 1] = station - model.station, 1.0
        # A line through a bent edge runs beside its middle, by half of the third of how far its ends bend away.
        H[rows, curvature] = place + length**2 / 24, slope
        H[rows, TREMBLE] = shift[start : start + 2] - by_plane[rows] @ shift[PLANE]
        H[rows, PLANE] = -by_plane[rows]
        left_out += [float(near_root(settings.edge_sigma_m)), float(near_root(settings.edge_slope_sigma))]
        H[rows, RECESS[side]] = -by_plane[rows, 0]
        parts[side] = rows
    if size == 1:
        H[0, PLANE] -= by_plane[0]
    turning = by_seen[:, -3:]
    by_surface = by_seen[:, :size] @ np.linalg.cholesky(surface_covariance)
    by_edges = by_seen[:, size:-3] * np.array(claimed).reshape(-1)
    new = np.hstack([by_surface * noise.surface, by_edges * noise.edges, turning * noise.attitude])
    R = new @ new.T + np.diag(np.square(left_out))
    z = value.copy()
    z[size:] -= by_plane[size:] @ plane
    if size == 1:
        z[0] -= by_plane[0] @ plane
    return Measurement(z, H, R, turning, by_surface, by_edges, parts)


def small_rotation(angles: Array) -> Array:
    """Rotation (3, 3) about the vector `angles` (3,) in radians, to first order."""
    x, y, z = angles
    return np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])


def jacobian(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    """Central differences (m, n) of a function from (n,) to (m,)."""
    steps = np.eye(len(at)) * step
    columns = [(function(at + d) - function(at - d)) / (2 * step) for d in steps]
    return np.stack(columns, axis=1)
