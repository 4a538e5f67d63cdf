"""What a line in the image is in space: a plane through the lens; and the stretch of the blade that it was seen on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vision.blade_model import BladeModel
from vision.blade_motion import PLANE
from vision.camera import Camera
from vision.observation import Edge

Array = NDArray[np.float64]


def image_plane(theta: float, rho: float, camera: Camera) -> Array:
    """Normal (3,), camera frame, of the plane through the lens whose image is the line (θ, ρ); it points along the
    line's normal (cos θ, sin θ)."""
    normal = np.array([np.cos(theta), np.sin(theta)])
    from_centre = np.array([camera.cx, camera.cy]) - camera.centre
    return np.array([normal @ from_centre - rho, camera.fx * normal[0], camera.fy * normal[1]])


def straightened(edge: Edge, camera: Camera) -> tuple[float, float]:
    """(θ, ρ) of the edge as a camera without distortion would see it; θ along the edge's outward normal, ρ signed."""
    theta, rho = edge.line.theta, edge.line.rho
    if camera.bends:
        rays = camera.rays(edge.ends + camera.centre)
        first, last = rays[:, 1:] * (camera.fx, camera.fy) + (camera.cx, camera.cy) - camera.centre
        along = (last - first) / np.linalg.norm(last - first)
        normal = np.array([-along[1], along[0]])
        theta, rho = float(np.arctan2(normal[1], normal[0])), float(normal @ first)
    if edge.outward @ (np.cos(theta), np.sin(theta)) < 0:
        theta, rho = theta + np.pi, -rho
    return theta, rho


def stretch(edge: Edge, camera: Camera, rotation: Array, lens: Array, model: BladeModel) -> tuple[float, float]:
    """(station of the middle, length along the span) in metres of the stretch of an edge that was seen, where it lies
    on the modelled surface; the reference's station and no length where it does not.

    rotation (3, 3), lens (3,): camera to blade coordinates.
    """
    depth, along, across = model.mean[PLANE]
    rays = camera.rays(edge.ends + camera.centre) @ rotation.T
    gradient = np.array([-along, -across, 1.0])
    closing = rays @ gradient
    behind = (np.array([model.station, model.offset, depth]) - lens) @ gradient
    if not (closing > 0.1).all() or behind <= 0:
        return model.station, 0.0
    stations = lens[0] + rays[:, 0] * behind / closing
    return float(stations.mean()), float(np.ptp(stations))
