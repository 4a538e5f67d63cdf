"""The z-buffer: which triangle is seen where, with perspective-correct depth, and how it is shaded.

Kernels are compiled by numba, release the interpreter lock, and are cached between runs. Image axes as in
`vision.camera`; the lens is a pinhole here, distortion is laid over the drawn image. Triangles with a corner nearer
than `NEAR_M` in front of the lens are left out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

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
                depths, owners = inverse[v], seen[v]
                for u in range(begin, end):
                    depth = np.float32(value + u * slope)
                    if depth > depths[u]:
                        depths[u] = depth
                        owners[u] = t


@compiled
def _plane(w: Any, f: Any, au: Any, av: Any, bu: Any, bv: Any, eu: Any, ev: Any, scale: Any) -> Any:
    """Coefficients in (u, v, 1) of f / depth, for values f at the corners and their 1/depth w."""
    fa, fb, fe = f[0] * w[0], f[1] * w[1], f[2] * w[2]
    du = ((fb - fa) * (ev - av) - (fe - fa) * (bv - av)) * scale
    dv = ((fe - fa) * (bu - au) - (fb - fa) * (eu - au)) * scale
    return du, dv, fa - du * au - dv * av


@compiled
def _planes(t: int, points: Any, triangles: Any, attributes: Any, lens: Any) -> Any:
    """Planes in the image of 1/depth and of the three attributes over depth, for triangle t: four times three
    numbers."""
    i, j, m = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    w = (1 / points[i, 0], 1 / points[j, 0], 1 / points[m, 0])
    au, av = lens[0] * points[i, 1] * w[0] + lens[2], lens[1] * points[i, 2] * w[0] + lens[3]
    bu, bv = lens[0] * points[j, 1] * w[1] + lens[2], lens[1] * points[j, 2] * w[1] + lens[3]
    eu, ev = lens[0] * points[m, 1] * w[2] + lens[2], lens[1] * points[m, 2] * w[2] + lens[3]
    area = (bu - au) * (ev - av) - (bv - av) * (eu - au)
    scale = 1 / area if area != 0 else 0.0
    one = (1.0, 1.0, 1.0)
    a = (attributes[i, 0], attributes[j, 0], attributes[m, 0])
    b = (attributes[i, 1], attributes[j, 1], attributes[m, 1])
    c = (attributes[i, 2], attributes[j, 2], attributes[m, 2])
    return (
        _plane(w, one, au, av, bu, bv, eu, ev, scale),
        _plane(w, a, au, av, bu, bv, eu, ev, scale),
        _plane(w, b, au, av, bu, bv, eu, ev, scale),
        _plane(w, c, au, av, bu, bv, eu, ev, scale),
    )


@compiled
def _surface(planes: Any, u: Any, v: Any, place: Any, skins: Any) -> Any:
    """Shade and dirt, both 0 to 1, of the surface at (u, v)."""
    w, a, b, c = planes
    depth = 1 / (w[0] * u + w[1] * v + w[2])
    shade = (a[0] * u + a[1] * v + a[2]) * depth
    along = (b[0] * u + b[1] * v + b[2]) * depth
    around = (c[0] * u + c[1] * v + c[2]) * depth
    offset, rows, columns, scale = place
    row = min(max(int(along * scale), 0), rows - 1)
    column = min(max(int(around * columns), 0), columns - 1)
    return shade, skins[offset + row * columns + column] * (1.0 / 255.0)


@compiled
def _mixed(inverse: Any, seen: Any, part: Any, v: int, u: int) -> bool:
    """Whether the four samples of pixel (v, u) see more than one surface."""
    y, x = 2 * v, 2 * u
    t, a, b, c = seen[y, x], seen[y, x + 1], seen[y + 1, x], seen[y + 1, x + 1]
    if t < 0 or a < 0 or b < 0 or c < 0:
        return True
    own = part[t]
    if part[a] != own or part[b] != own or part[c] != own:
        return True
    p, q, r, s = inverse[y, x], inverse[y, x + 1], inverse[y + 1, x], inverse[y + 1, x + 1]
    near = max(max(p, q), max(r, s))
    return bool(near - min(min(p, q), min(r, s)) > FLAT * near)


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
    current = -1
    planes = _planes(0, points, triangles, attributes, lens)
    place = (layout[0, 0], layout[0, 1], layout[0, 2], layout[0, 3])
    blue, green, red, less_blue, less_green, less_red = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for v in range(height):
        for u in range(width):
            samples = 1
            t = seen[v * factor, u * factor]
            if factor == 2 and (
                seen[2 * v, 2 * u + 1] != t or seen[2 * v + 1, 2 * u] != t or seen[2 * v + 1, 2 * u + 1] != t
            ):
                samples = 4 if _mixed(inverse, seen, part, v, u) else 1
            if samples == 1 and t < 0:
                continue
            b, g, r = 0.5, 0.5, 0.5
            for sample in range(samples):
                du, dv = 0.0, 0.0
                if samples == 4:
                    t = seen[2 * v + sample // 2, 2 * u + sample % 2]
                    du, dv = (sample % 2) * 0.5 - 0.25, (sample // 2) * 0.5 - 0.25
                    if t < 0:
                        b, g, r = b + 0.25 * image[v, u, 0], g + 0.25 * image[v, u, 1], r + 0.25 * image[v, u, 2]
                        continue
                if t != current:
                    planes = _planes(t, points, triangles, attributes, lens)
                    current = t
                    k = part[t]
                    place = (layout[k, 0], layout[k, 1], layout[k, 2], layout[k, 3])
                    blue, green, red = tint[k, 0], tint[k, 1], tint[k, 2]
                    less_blue, less_green, less_red = tint[k, 3], tint[k, 4], tint[k, 5]
                light, dirt = _surface(planes, u + du, v + dv, place, skins)
                light /= samples
                b += light * blue * (1 - dirt * less_blue)
                g += light * green * (1 - dirt * less_green)
                r += light * red * (1 - dirt * less_red)
            image[v, u, 0] = min(max(int(b), 0), 255)
            image[v, u, 1] = min(max(int(g), 0), 255)
            image[v, u, 2] = min(max(int(r), 0), 255)
