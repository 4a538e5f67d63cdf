"""The blade's axis, and its width in metres between its two edges, on the measured surface."""

from __future__ import annotations

from math import atan2, copysign, cos, pi, sin, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera
from vision.candidates import Candidate
from vision.surface import Surface

Array = NDArray[Any]  # of floats


def chord(
    edges: tuple[Candidate, ...], axis: float, camera: Camera, surface: Surface, near: Array
) -> tuple[float, float] | None:
    """(chord, its standard deviation) in metres at the station of the blade nearest to `near` (2,), image frame; None
    unless both edges are seen."""
    if len(edges) != 2:
        return None
    along = np.array([np.cos(axis), np.sin(axis)])
    across = np.array([-along[1], along[0]])
    station = float(near @ along)
    points = []
    for edge in edges:
        offset = (edge.rho - station * float(edge.outward @ along)) / float(edge.outward @ across)
        points.append(station * along + offset * across)
    rays = camera.rays(np.array(points) + camera.centre)
    inverse = (1 - rays[:, 1:] @ surface.slope) / surface.depth_m
    if (inverse <= 0).any():
        return None
    ends = rays / inverse[:, None]
    width = float(np.linalg.norm(ends[0] - ends[1]))
    pixel = float(ends[:, 0].mean()) / camera.fx
    edge_sigma = np.hypot(*(edge.profile.rho_sigma[edge.index] for edge in edges)) * pixel
    lever = np.array([1.0, *ends.mean(axis=0)[1:]]) / max(surface.depth_m, 1e-6)
    depth_sigma = width * np.sqrt(max(float(lever @ surface.covariance @ lever), 0.0))
    return width, float(np.sqrt(edge_sigma**2 + depth_sigma**2 + (0.004 * width) ** 2))


def heading(edges: tuple[Candidate, ...], axis: float, camera: Camera, surface: Surface, near: Array) -> float:
    """Direction of the blade's axis in the image, modulo π, perspective taken out: edges that are parallel on the blade
    converge in the image of a tilted one.

    It is what the axis shows midway between two edges at the station nearest to `near` (2,), image frame, and with
    one edge what it would show in the image centre.
    """
    x, y = cos(axis), sin(axis)
    u, v = near.tolist()
    station = u * x + v * y
    points, feet = [], []
    for edge in edges:
        (out_x, out_y), (way_x, way_y) = edge.outward.tolist(), edge.profile.direction[edge.index].tolist()
        offset = (edge.rho - station * (out_x * x + out_y * y)) / (out_y * x - out_x * y)
        foot_u, foot_v = station * x - offset * y, station * y + offset * x
        points += [(foot_u - 60.0 * way_x, foot_v - 60.0 * way_y), (foot_u + 60.0 * way_x, foot_v + 60.0 * way_y)]
        feet.append((foot_u, foot_v))
    points.append((sum(f[0] for f in feet) / 2, sum(f[1] for f in feet) / 2) if len(feet) == 2 else (0.0, 0.0))
    rays = camera.rays(np.array(points) + camera.centre)
    inverse = (1 - rays[:-1, 1:] @ surface.slope) / surface.depth_m
    if not inverse.min() > 0:
        return axis
    ends = (rays[:-1] / inverse[:, None]).tolist()
    ahead, right, down = 0.0, 0.0, 0.0
    for one, two in zip(ends[::2], ends[1::2], strict=True):
        a, b, c = two[0] - one[0], two[1] - one[1], two[2] - one[2]
        length = copysign(sqrt(a * a + b * b + c * c), b * x + c * y)
        ahead, right, down = ahead + a / length, right + b / length, down + c / length
    _, ray_right, ray_down = rays[-1].tolist()
    return atan2(down - ray_down * ahead, right - ray_right * ahead) % pi
