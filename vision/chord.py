"""The blade's axis, and its width in metres between its two edges, on the measured surface."""

from __future__ import annotations

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
    along = np.array([np.cos(axis), np.sin(axis)])
    across = np.array([-along[1], along[0]])
    station = float(near @ along)
    mean, middle = np.zeros(3), np.zeros(2)
    for edge in edges:
        direction = edge.profile.direction[edge.index]
        offset = (edge.rho - station * float(edge.outward @ along)) / float(edge.outward @ across)
        foot = station * along + offset * across
        rays = camera.rays(foot + np.array([[-60.0], [60.0]]) * direction + camera.centre)
        inverse = (1 - rays[:, 1:] @ surface.slope) / surface.depth_m
        if (inverse <= 0).any():
            return axis
        ends = rays / inverse[:, None]
        run = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        mean += run if run[1:] @ along > 0 else -run
        middle += foot / len(edges)
    if len(edges) == 1:
        middle = np.zeros(2)
    ray = camera.rays((middle + camera.centre)[None])[0]
    shown = mean[1:] - ray[1:] * mean[0]
    return float(np.arctan2(shown[1], shown[0]) % np.pi)
