"""How near a point is to the turbine: exact distances to its triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.world.mesh import Mesh
from vision.compiled import compiled

Array = NDArray[np.float64]


@compiled
def _squared(px: Any, py: Any, pz: Any, a: Any, b: Any, c: Any) -> Any:
    """Squared distance of p from the triangle a, b, c (Ericson, Real-Time Collision Detection, 5.1.5)."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = px - a[0], py - a[1], pz - a[2]
    uu, ww, uw = ux * ux + uy * uy + uz * uz, wx * wx + wy * wy + wz * wz, ux * wx + uy * wy + uz * wz
    d1, d2 = ux * x + uy * y + uz * z, wx * x + wy * y + wz * z
    d3, d4, d5, d6 = d1 - uu, d2 - uw, d1 - uw, d2 - ww
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        s, t = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        s, t = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        s, t = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s, t = d1 / (d1 - d3), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        s, t = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        s = 1.0 - t
    else:
        scale = 1.0 / (va + vb + vc)
        s, t = vb * scale, vc * scale
    dx, dy, dz = x - s * ux - t * wx, y - s * uy - t * wy, z - s * uz - t * wz
    return dx * dx + dy * dy + dz * dz


@compiled
def _nearest(
    points: Any, wanted: Any, vertices: Any, triangles: Any, part: Any, start: Any, centre: Any, radius: Any
) -> Any:
    out = np.empty(len(points))
    gaps = np.empty(len(radius))
    for i in range(len(points)):
        px, py, pz = points[i, 0], points[i, 1], points[i, 2]
        for k in range(len(radius)):
            dx, dy, dz = centre[k, 0] - px, centre[k, 1] - py, centre[k, 2] - pz
            gaps[k] = np.sqrt(dx * dx + dy * dy + dz * dz) - radius[k]
        best = np.inf
        for k in np.argsort(gaps):
            if gaps[k] > 0 and gaps[k] * gaps[k] >= best:
                break
            for t in range(start[k], start[k + 1]):
                if wanted[part[t]]:
                    a, b, c = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
                    best = min(best, _squared(px, py, pz, a, b, c))
        out[i] = np.sqrt(best)
    return out


def distances(mesh: Mesh, points: Array, parts: tuple[int, ...] | None = None) -> Array:
    """Distance (n,) in metres of points (n, 3) in local NED from the nearest triangle of the parts, of all by
    default."""
    wanted = np.zeros(256, bool)
    wanted[slice(None) if parts is None else list(parts)] = True
    points = np.ascontiguousarray(points, float).reshape(-1, 3)
    result: Array = _nearest(
        points, wanted, mesh.vertices, mesh.triangles, mesh.part, mesh.start, mesh.centre, mesh.radius
    )
    return result
