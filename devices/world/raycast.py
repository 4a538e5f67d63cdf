"""Rays against the turbine's triangles: laser dots, hidden points, the range finder."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.world.mesh import Mesh
from vision.compiled import compiled

Array = NDArray[np.float64]


@compiled
def _cast(
    origins: Any, rays: Any, reach: Any, vertices: Any, triangles: Any, start: Any, centre: Any, radius: Any
) -> Any:
    distance = reach.copy()
    hit = np.full(len(rays), -1, np.int32)
    for i in range(len(rays)):
        ox, oy, oz = origins[i, 0], origins[i, 1], origins[i, 2]
        dx, dy, dz = rays[i, 0], rays[i, 1], rays[i, 2]
        for k in range(len(radius)):
            cx, cy, cz = centre[k, 0] - ox, centre[k, 1] - oy, centre[k, 2] - oz
            along = cx * dx + cy * dy + cz * dz
            r = radius[k]
            if along < -r or along - r > distance[i]:
                continue
            if cx * cx + cy * cy + cz * cz - along * along > r * r:
                continue
            for t in range(start[k], start[k + 1]):
                a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
                ax, ay, az = vertices[a, 0], vertices[a, 1], vertices[a, 2]
                px, py, pz = vertices[b, 0] - ax, vertices[b, 1] - ay, vertices[b, 2] - az
                qx, qy, qz = vertices[c, 0] - ax, vertices[c, 1] - ay, vertices[c, 2] - az
                hx, hy, hz = dy * qz - dz * qy, dz * qx - dx * qz, dx * qy - dy * qx
                det = px * hx + py * hy + pz * hz
                if abs(det) < 1e-14:
                    continue
                sx, sy, sz = ox - ax, oy - ay, oz - az
                u = (sx * hx + sy * hy + sz * hz) / det
                if u < 0.0 or u > 1.0:
                    continue
                wx, wy, wz = sy * pz - sz * py, sz * px - sx * pz, sx * py - sy * px
                v = (dx * wx + dy * wy + dz * wz) / det
                if v < 0.0 or u + v > 1.0:
                    continue
                d = (qx * wx + qy * wy + qz * wz) / det
                if 0.0 < d < distance[i]:
                    distance[i] = d
                    hit[i] = t
    return distance, hit


def cast(mesh: Mesh, origins: Array, rays: Array, reach: float | Array) -> tuple[Array, NDArray[np.int32]]:
    """First hits of unit rays (n, 3) from origins (n, 3) or (3,) in local NED: distance (n,) m, at most `reach`, and
    the triangle (n,), -1 where nothing was hit."""
    # Copies, for a kernel is compiled anew for arrays that cannot be written to.
    rays = np.array(rays, float, order="C").reshape(-1, 3)
    origins = np.array(np.broadcast_to(origins, rays.shape), float, order="C")
    reach = np.array(np.broadcast_to(reach, len(rays)), float, order="C")
    distance, hit = _cast(origins, rays, reach, mesh.vertices, mesh.triangles, mesh.start, mesh.centre, mesh.radius)
    return distance, hit


def hidden(mesh: Mesh, eye: Array, points: Array, tolerance_m: float = 0.02) -> NDArray[np.bool_]:
    """Whether something stands between the eye (3,) and each point (n, 3); surfaces within the tolerance of a point do
    not."""
    offset = np.asarray(points, float).reshape(-1, 3) - eye
    length = np.linalg.norm(offset, axis=1)
    _, hit = cast(mesh, eye, offset / np.maximum(length, 1e-9)[:, None], np.maximum(length - tolerance_m, 0.0))
    blocked: NDArray[np.bool_] = hit >= 0
    return blocked
