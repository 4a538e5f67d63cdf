"""The eye before a drawn turbine: a wide, streaked blade that darkens toward its rim, before fields."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from devices.world.settings import WorldSettings
from devices.world.turbine import TurbineShape
from devices.world.view import Renderer, draw
from tests.vision.test_tracker_in_world import CAMERA, GEOMETRY
from vision.capture import CameraPose, rotation_of
from vision.observation import Edge
from vision.pipeline import Eye

Array = NDArray[np.float64]


def outline(shape: TurbineShape, pose: CameraPose) -> tuple[Array, Array]:
    """Both silhouettes of the inspected blade, (n, 2) px of the image frame: the outermost of its skin's points."""
    stations = shape.blade.stations
    skin = shape.blade_frame().to_ned(shape.blade.sections(stations)[:, :-1].reshape(-1, 3))
    seen = pose.from_ned(skin).reshape(len(stations), -1, 3)
    seen = seen[(seen[..., 0] > 0.5).all(axis=1)]
    pixels = CAMERA.project(seen.reshape(-1, 3)).reshape(*seen.shape[:2], 2) - CAMERA.centre
    middle = pixels.mean(axis=1)
    way = np.gradient(middle, axis=0)
    across = np.einsum("nki,ni->nk", pixels - middle[:, None], np.stack([-way[:, 1], way[:, 0]], axis=1))
    rows = np.arange(len(pixels))
    return pixels[rows, across.argmax(axis=1)], pixels[rows, across.argmin(axis=1)]


def errors(edge: Edge, line: Array) -> tuple[float, float]:
    """Angle in degrees and distance in px between an edge's middle and the nearest piece of a line (n, 2)."""
    middle = edge.ends.mean(axis=0)
    start, way = line[:-1], np.diff(line, axis=0)
    share = np.clip(((middle - start) * way).sum(axis=1) / (way**2).sum(axis=1), 0, 1)
    away = np.hypot(*(start + share[:, None] * way - middle).T)
    nearest = int(away.argmin())
    along = way[nearest] / np.hypot(*way[nearest])
    return float(np.rad2deg(np.arcsin(min(abs(float(along @ edge.outward)), 1.0)))), float(away[nearest])


def test_a_clear_rim_is_found_and_no_streak_is_taken_for_it() -> None:
    shape = TurbineShape(north_m=60, east_m=10, heading_deg=11, azimuth_deg=92)
    renderer, eye = Renderer(shape, WorldSettings(seed=97)), Eye(GEOMETRY)
    look, found = rotation_of(0.0, 0.0, np.deg2rad(11)), 0
    stations = np.arange(13.0, 22.0, 0.75)
    for k, station in enumerate(stations):
        rim = shape.edges(np.array([station]))[0][0]
        pose = CameraPose(rim + np.array([0.0, 0.0, -0.85]) - 3.0 * look[:, 0], look)
        seen = eye.observe(draw(renderer, GEOMETRY, pose, frame=k))
        assert seen.valid
        both = outline(shape, pose)
        wrong = [min(errors(edge, line) for line in both) for edge in seen.edges]
        assert all(angle < 3 and away < 6 for angle, away in wrong), f"at {station} m: {wrong}"
        found += any(errors(edge, both[0])[1] < 6 for edge in seen.edges)
    assert found >= 0.9 * len(stations)
