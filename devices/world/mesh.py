"""Triangles of the simulated turbine: surfaces laid as grids, joined, and gathered into small clusters for culling."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int32]

TILE = 8  # quads along and around in one cluster


@dataclass(frozen=True)
class Surface:
    """One grid of points (n, m, 3), its outward normals (n, m, 3), what it belongs to, and where on its skin it lies.

    skin (n, m, 2): metres along, and share of the way around, for dirt and marks.
    """

    points: Array
    normals: Array
    part: int
    skin: Array


@dataclass(frozen=True)
class Mesh:
    """vertices (n, 3) m in local NED with outward unit normals (n, 3) and skin coordinates (n, 2); triangles (m, 3),
    their corners so ordered that (b - a) × (c - a) points outward; part (m,). Triangles [start[k], start[k + 1]) form
    cluster k, inside the sphere `centre[k]`, `radius[k]`."""

    vertices: Array
    normals: Array
    skin: NDArray[np.float32]
    triangles: Indices
    part: NDArray[np.uint8]
    start: Indices
    centre: Array
    radius: Array


def grid(points: Array, part: int, skin: Array, closed: bool, inside: Array) -> Surface:
    """A surface through points (n, m, 3), normals by differences, turned away from the points `inside` (n, 1, 3).

    closed: the last column repeats the first, so that differences wrap around.
    """
    along = np.gradient(points, axis=0)
    if closed:
        ring = points[:, :-1]
        around = np.roll(ring, -1, axis=1) - np.roll(ring, 1, axis=1)
        around = np.concatenate([around, around[:, :1]], axis=1)
    else:
        around = np.gradient(points, axis=1)
    normals = np.cross(along, around)
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)
    if np.sum(normals * (points - inside)) < 0:
        normals = -normals
    return Surface(points, normals, part, skin)


def disc(rim: Array, part: int, skin: Array, outward: Array) -> Surface:
    """A flat end (2, m, 3) between a closed rim (m, 3) and its middle, facing `outward` (3,)."""
    points = np.stack([np.broadcast_to(rim.mean(axis=0), rim.shape), rim])
    return Surface(points, np.broadcast_to(outward, points.shape).copy(), part, np.stack([skin, skin]))


def joined(surfaces: Sequence[Surface]) -> Mesh:
    """All surfaces as one mesh, without triangles of no area."""
    vertices, normals, skin, triangles, part, keys = [], [], [], [], [], []
    count = 0
    for number, surface in enumerate(surfaces):
        n, m = surface.points.shape[:2]
        index = np.arange(n * m, dtype=np.int32).reshape(n, m)
        a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
        corners = np.concatenate(
            [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)]
        )
        i, j = np.divmod(np.arange((n - 1) * (m - 1)), m - 1)
        key = np.tile((number * 1000 + i // TILE) * 1000 + j // TILE, 2)
        points = surface.points.reshape(-1, 3)
        facing = surface.normals.reshape(-1, 3)
        p, q, r = (points[corners[:, k]] for k in range(3))
        area = np.cross(q - p, r - p)
        flip = np.einsum("ij,ij->i", area, facing[corners].sum(axis=1)) < 0
        corners[flip] = corners[flip][:, ::-1]
        solid = np.linalg.norm(area, axis=1) > 1e-10
        vertices.append(points)
        normals.append(facing)
        skin.append(surface.skin.reshape(-1, 2))
        triangles.append(corners[solid] + count)
        part.append(np.full(int(solid.sum()), surface.part, np.uint8))
        keys.append(key[solid])
        count += len(points)
    key = np.concatenate(keys)
    order = np.argsort(key, kind="stable")
    corners = np.concatenate(triangles)[order].astype(np.int32)
    everything = np.concatenate(vertices)
    start = np.append(np.flatnonzero(np.r_[True, np.diff(key[order]) != 0]), len(order)).astype(np.int32)
    centre = np.empty((len(start) - 1, 3))
    radius = np.empty(len(start) - 1)
    for k in range(len(radius)):
        own = everything[corners[start[k] : start[k + 1]].ravel()]
        centre[k] = (own.min(axis=0) + own.max(axis=0)) / 2
        radius[k] = np.linalg.norm(own - centre[k], axis=1).max()
    return Mesh(
        everything,
        np.concatenate(normals),
        np.concatenate(skin).astype(np.float32),
        corners,
        np.concatenate(part)[order],
        start,
        centre,
        radius,
    )
