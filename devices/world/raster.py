"""The z-buffer: which triangle is seen where, with perspective-correct depth, and how it is shaded.

Kernels are compiled by numba, release the interpreter lock, and are cached between runs. Image axes as in
`vision.camera`; the lens is a pinhole here, distortion is laid over the drawn image. Triangles with a corner nearer
than `NEAR_M` in front of the lens are left out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from devices.world.compiled import compiled

Array = NDArray[np.float64]
NEAR_M = 0.05
FLAT = 0.02  # within one pixel, samples whose depths agree to this share belong to one surface


@compiled
def transform(vertices: Any, rotation: Any, position: Any, out: Any) -> None:
    """out = (vertices - position) @ rotation: local NED (n, 3) to the camera frame."""
    for i in range(vertices.shape[0]):
        x = vertices[i, 0] - position[0]
        y = vertices[i, 1] - position[1]
        z = vertices[i, 2] - position[2]
        for k in range(3):
            out[i, k] = x * rotation[0, k] + y * rotation[1, k] + z * rotation[2, k]


@compiled
def visible_clusters(centre: Any, radius: Any, rotation: Any, position: Any, lens: Any, width: int, height: int) -> Any:
    """Indices of the clusters whose sphere touches the view. lens: fx, fy, cx, cy."""
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    left, right = (-0.5 - cx) / fx, (width - 0.5 - cx) / fx
    top, bottom = (-0.5 - cy) / fy, (height - 0.5 - cy) / fy
    found = np.empty(len(radius), np.int32)
    count = 0
    for k in range(len(radius)):
        dx, dy, dz = centre[k, 0] - position[0], centre[k, 1] - position[1], centre[k, 2] - position[2]
        x = dx * rotation[0, 0] + dy * rotation[1, 0] + dz * rotation[2, 0]
        y = dx * rotation[0, 1] + dy * rotation[1, 1] + dz * rotation[2, 1]
        z = dx * rotation[0, 2] + dy * rotation[1, 2] + dz * rotation[2, 2]
        r = radius[k]
        if x < -r:
            continue
        if y - right * x > r * np.sqrt(1 + right * right) or left * x - y > r * np.sqrt(1 + left * left):
            continue
        if z - bottom * x > r * np.sqrt(1 + bottom * bottom) or top * x - z > r * np.sqrt(1 + top * top):
            continue
        found[count] = k
        count += 1
    return found[:count]


@compiled
def visibility(points: Any, triangles: Any, start: Any, clusters: Any, lens: Any, inverse: Any, seen: Any) -> None:
    """Draw the clusters' front faces: inverse (h, w) is 1/depth, 0 where nothing is; seen (h, w) the triangle, -1
    where none.

    A sample (u, v) belongs to a triangle when its centre lies inside; neighbours share their edge without gap or
    overlap."""
    height, width = inverse.shape
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    inverse[:] = 0.0
    seen[:] = -1
    for k in range(len(clusters)):
        for t in range(start[clusters[k]], start[clusters[k] + 1]):
            i, j, m = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            ax, ay, az = points[i, 0], points[i, 1], points[i, 2]
            bx, by, bz = points[j, 0], points[j, 1], points[j, 2]
            ex, ey, ez = points[m, 0], points[m, 1], points[m, 2]
            if ax < NEAR_M or bx < NEAR_M or ex < NEAR_M:
                continue
            px, py, pz = bx - ax, by - ay, bz - az
            qx, qy, qz = ex - ax, ey - ay, ez - az
            nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
            facing = nx * ax + ny * ay + nz * az
            if facing >= 0.0:
                continue
            au, av = fx * ay / ax + cx, fy * az / ax + cy
            bu, bv = fx * by / bx + cx, fy * bz / bx + cy
            eu, ev = fx * ey / ex + cx, fy * ez / ex + cy
            first, last = max(int(np.ceil(min(av, bv, ev))), 0), min(int(np.floor(max(av, bv, ev))), height - 1)
            if first > last or max(au, bu, eu) < 0 or min(au, bu, eu) > width - 1:
                continue
            slope = ny / fx / facing
            constant = (nx - ny * cx / fx - nz * cy / fy) / facing
            for v in range(first, last + 1):
                low, high = np.inf, -np.inf
                for side in range(3):
                    if side == 0:
                        u0, v0, u1, v1 = au, av, bu, bv
                    elif side == 1:
                        u0, v0, u1, v1 = bu, bv, eu, ev
                    else:
                        u0, v0, u1, v1 = eu, ev, au, av
                    if v0 > v1:
                        u0, v0, u1, v1 = u1, v1, u0, v0
                    if v0 <= v < v1:
                        u = u0 + (v - v0) * (u1 - u0) / (v1 - v0)
                        low, high = min(low, u), max(high, u)
                if low > high:
                    continue
                begin, end = max(int(np.ceil(low)), 0), min(int(np.ceil(high)), width)
                value = constant + v * nz / fy / facing
                for u in range(begin, end):
                    depth = value + u * slope
                    if depth > inverse[v, u]:
                        inverse[v, u] = depth
                        seen[v, u] = t


@compiled
def _planes(t: int, points: Any, triangles: Any, attributes: Any, lens: Any, planes: Any) -> None:
    """planes (k + 1, 3): coefficients in (u, v, 1) of 1/depth and of each attribute over depth, for triangle t."""
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    i, j, m = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    wa, wb, we = 1 / points[i, 0], 1 / points[j, 0], 1 / points[m, 0]
    au, av = fx * points[i, 1] * wa + cx, fy * points[i, 2] * wa + cy
    bu, bv = fx * points[j, 1] * wb + cx, fy * points[j, 2] * wb + cy
    eu, ev = fx * points[m, 1] * we + cx, fy * points[m, 2] * we + cy
    area = (bu - au) * (ev - av) - (bv - av) * (eu - au)
    scale = 1 / area if area != 0 else 0.0
    for k in range(planes.shape[0]):
        if k == 0:
            fa, fb, fe = wa, wb, we
        else:
            fa, fb, fe = attributes[i, k - 1] * wa, attributes[j, k - 1] * wb, attributes[m, k - 1] * we
        du = ((fb - fa) * (ev - av) - (fe - fa) * (bv - av)) * scale
        dv = ((fe - fa) * (bu - au) - (fb - fa) * (eu - au)) * scale
        planes[k, 0], planes[k, 1], planes[k, 2] = du, dv, fa - du * au - dv * av


@compiled
def _colour(planes: Any, u: float, v: float, part: int, skins: Any, layout: Any, tint: Any, colour: Any) -> None:
    """colour (3,) BGR of the surface at (u, v): shade × paint × dirt of its skin."""
    depth = 1 / (planes[0, 0] * u + planes[0, 1] * v + planes[0, 2])
    shade = (planes[1, 0] * u + planes[1, 1] * v + planes[1, 2]) * depth
    along = (planes[2, 0] * u + planes[2, 1] * v + planes[2, 2]) * depth
    around = (planes[3, 0] * u + planes[3, 1] * v + planes[3, 2]) * depth
    offset, rows, columns, scale = layout[part, 0], layout[part, 1], layout[part, 2], layout[part, 3]
    row = int(max(along, 0.0) * scale) % rows
    column = min(max(int(around * columns), 0), columns - 1)
    dirt = skins[offset + row * columns + column] * (1.0 / 255.0)
    for c in range(3):
        colour[c] = shade * tint[part, c] * (1 - dirt * tint[part, 3 + c])


@compiled
def shade(
    points: Any,
    triangles: Any,
    part: Any,
    attributes: Any,
    lens: Any,
    inverse: Any,
    seen: Any,
    skins: Any,
    layout: Any,
    tint: Any,
    image: Any,
) -> None:
    """Colour `image` (h, w, 3) where triangles are seen; where a pixel's samples disagree, their mean.

    inverse, seen: of `visibility` at once or twice the image's resolution. lens: of the image. attributes (n, 3):
    shade 0 to 1, metres along and share around. skins: dirt 0 to 255 of every part, found through layout (parts, 4):
    offset, rows, columns, rows a metre. tint (parts, 6): BGR at full light, then how much full dirt takes of each."""
    height, width = image.shape[:2]
    factor = seen.shape[0] // height
    planes = np.empty((4, 3))
    colour, mean = np.empty(3), np.empty(3)
    current = -1
    for v in range(height):
        for u in range(width):
            t = seen[v * factor, u * factor]
            one = True
            if factor == 2:
                a, b, c = seen[2 * v, 2 * u + 1], seen[2 * v + 1, 2 * u], seen[2 * v + 1, 2 * u + 1]
                if a != t or b != t or c != t:
                    if (
                        t < 0
                        or a < 0
                        or b < 0
                        or c < 0
                        or part[a] != part[t]
                        or part[b] != part[t]
                        or part[c] != part[t]
                    ):
                        one = False
                    else:
                        near = max(
                            inverse[2 * v, 2 * u],
                            inverse[2 * v, 2 * u + 1],
                            inverse[2 * v + 1, 2 * u],
                            inverse[2 * v + 1, 2 * u + 1],
                        )
                        far = min(
                            inverse[2 * v, 2 * u],
                            inverse[2 * v, 2 * u + 1],
                            inverse[2 * v + 1, 2 * u],
                            inverse[2 * v + 1, 2 * u + 1],
                        )
                        one = near - far < FLAT * near
            if one:
                if t < 0:
                    continue
                if t != current:
                    _planes(t, points, triangles, attributes, lens, planes)
                    current = t
                _colour(planes, u, v, part[t], skins, layout, tint, colour)
                for k in range(3):
                    image[v, u, k] = min(max(int(colour[k] + 0.5), 0), 255)
                continue
            mean[:] = 0.0
            for sample in range(4):
                dv, du = sample // 2, sample % 2
                t = seen[2 * v + dv, 2 * u + du]
                if t < 0:
                    for k in range(3):
                        mean[k] += image[v, u, k]
                    continue
                if t != current:
                    _planes(t, points, triangles, attributes, lens, planes)
                    current = t
                _colour(planes, u + du * 0.5 - 0.25, v + dv * 0.5 - 0.25, part[t], skins, layout, tint, colour)
                for k in range(3):
                    mean[k] += colour[k]
            for k in range(3):
                image[v, u, k] = min(max(int(mean[k] * 0.25 + 0.5), 0), 255)
