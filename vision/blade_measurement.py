"""What an observation in the camera says of the blade in its own frame, with the covariance of all of it together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vision.blade_model import EDGE, PLANE, SIZE, BladeModel, Side, TrackerSettings
from vision.camera import Camera
from vision.capture import CameraPose
from vision.estimate import BladeFrame
from vision.observation import BladeObservation, Edge

Array = NDArray[np.float64]
PATCH_M = 3.0  # distance for which the settings say how far a surface is from a plane


@dataclass(frozen=True)
class Measurement:
    """One linearised measurement: z = H x + noise of covariance R. parts: name → rows, the surface first."""

    z: Array
    H: Array
    R: Array
    parts: dict[str, slice]


def image_plane(theta: float, rho: float, camera: Camera) -> Array:
    """Normal (3,), camera frame, of the plane through the lens whose image is the line (θ, ρ); it points along the
    line's normal (cos θ, sin θ)."""
    normal = np.array([np.cos(theta), np.sin(theta)])
    from_centre = np.array([camera.cx, camera.cy]) - camera.centre
    return np.array([normal @ from_centre - rho, camera.fx * normal[0], camera.fy * normal[1]])


def straightened(edge: Edge, camera: Camera) -> tuple[float, float]:
    """(θ, ρ) of the edge as a camera without distortion would see it; θ along the edge's outward normal, ρ signed."""
    theta, rho = edge.line.theta, edge.line.rho
    if any(camera.distortion):
        rays = camera.rays(edge.ends + camera.centre)
        first, last = rays[:, 1:] * (camera.fx, camera.fy) + (camera.cx, camera.cy) - camera.centre
        along = (last - first) / np.linalg.norm(last - first)
        normal = np.array([-along[1], along[0]])
        theta, rho = float(np.arctan2(normal[1], normal[0])), float(normal @ first)
    if edge.outward @ (np.cos(theta), np.sin(theta)) < 0:
        theta, rho = theta + np.pi, -rho
    return theta, rho


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
) -> Measurement:
    """The observation's plane (or distance alone) and edges as one measurement of the model's state, linearised around
    it.

    An edge in the image is a plane through the lens; where it cuts the *modelled* surface lies the measured edge, so
    that its rows depend on the state's surface too. Errors of the camera's pose are common to all rows.
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
    position = np.zeros(3)
    turned = np.zeros(3)
    seen = np.concatenate([surface, lines, position, turned])
    size = len(surface)
    noise = np.zeros((len(seen), len(seen)))
    noise[:size, :size] = surface_covariance
    for i, side in enumerate(sides):
        rows = slice(size + 2 * i, size + 2 * i + 2)
        noise[rows, rows] = np.diag([edges[side].sigma_theta ** 2, edges[side].sigma_rho_px ** 2])
    noise[-6:-3, -6:-3] = np.eye(3) * pose.sigma_m**2
    noise[-3:, -3:] = np.eye(3) * settings.attitude_sigma**2

    to_blade = frame.rotation
    camera_to_blade = to_blade @ pose.rotation
    lens_here = frame.to_blade(pose.position)
    reference = np.array([model.station, model.offset])

    def in_blade_frame(seen: Array, plane: Array) -> Array:
        lens = lens_here + to_blade @ seen[-6:-3]
        rotation = camera_to_blade @ small_rotation(seen[-3:])
        result = np.empty(size + 2 * len(sides))
        hit = lens + rotation[:, 0] * seen[0]
        normal = rotation @ np.array([1.0, -seen[1], -seen[2]]) if size == 3 else np.array([-plane[1], -plane[2], 1.0])
        slopes = -normal[:2] / normal[2]
        result[0] = hit[2] + slopes @ (reference - hit[:2])
        if size == 3:
            result[1:3] = slopes
        for i in range(len(sides)):
            cut = rotation @ image_plane(seen[size + 2 * i], seen[size + 2 * i + 1], camera)
            lean = cut[1] + cut[2] * plane[2]
            at_reference = cut[0] * (model.station - lens[0]) + cut[2] * (plane[0] - plane[2] * model.offset - lens[2])
            result[size + 2 * i] = (cut[1] * lens[1] - at_reference) / lean
            result[size + 2 * i + 1] = -(cut[0] + cut[2] * plane[1]) / lean
        return result

    plane = model.mean[PLANE]
    value = in_blade_frame(seen, plane)
    by_seen = jacobian(lambda p: in_blade_frame(p, plane), seen)
    by_plane = jacobian(lambda p: in_blade_frame(seen, p), plane)
    H = np.zeros((len(value), SIZE))
    H[:size, :size] = np.eye(size)
    # The dots cover more of a round surface from farther away, and a plane fits that the worse.
    wide = max(observation.distance_m / PATCH_M, 1.0)
    left_out = [settings.surface_sigma_m * wide**2, *[settings.surface_slope_sigma * wide] * 2][:size]
    parts = {"surface": slice(0, size)}
    for i, side in enumerate(sides):
        rows = slice(size + 2 * i, size + 2 * i + 2)
        H[rows, EDGE[side]] = np.eye(2)
        H[rows, PLANE] = -by_plane[rows]
        left_out += [settings.edge_sigma_m, settings.edge_slope_sigma]
        # An edge lies behind the middle of a round surface: seen from aside that shifts it.
        left_out[-2] = np.hypot(left_out[-2], by_plane[rows.start, 0] * settings.edge_depth_sigma_m)
        parts[side] = rows
    if size == 1:
        H[0, PLANE] -= by_plane[0]
    R = by_seen @ noise @ by_seen.T + np.diag(np.square(left_out))
    z = value.copy()
    z[size:] += H[size:, PLANE] @ plane
    if size == 1:
        z[0] -= by_plane[0] @ plane
    return Measurement(z, H, R, parts)


def small_rotation(angles: Array) -> Array:
    """Rotation (3, 3) about the vector `angles` (3,) in radians, to first order."""
    x, y, z = angles
    return np.array([[1.0, -z, y], [z, 1.0, -x], [-y, x, 1.0]])


def jacobian(function: Callable[[Array], Array], at: Array, step: float = 1e-6) -> Array:
    """Central differences (m, n) of a function from (n,) to (m,)."""
    steps = np.eye(len(at)) * step
    columns = [(function(at + d) - function(at - d)) / (2 * step) for d in steps]
    return np.stack(columns, axis=1)
