"""Inner loops of the rotor model: the outlines of its blades, and what of them the picture agrees with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Array = NDArray[Any]

THICKEST = 0.32  # of the chord behind the leading edge a foil is thickest
CHANCE = 0.45  # share of a line anywhere in a picture along which that changes


@compiled
def trace(p: Array, table: Array, cone: float, shape: Array, lens: Array, points: Array) -> None:
    """Write where the edges of one rotor p (12,) lie: points (3, 2, n, 2), blade, leading and trailing, station.

    table (n, 6): station, rise, fall, thickness over chord, place of the axis, twist; shape (3,): root's diameter,
    largest chord, tip's chord, all in rotor radii; lens (4,): fx, fy and the image frame's offset.
    """
    fx, fy = lens[0], lens[1]
    hx, hy, hz = 1.0, (p[0] - lens[2]) / fx, (p[1] - lens[3]) / fy
    radius = np.exp(p[6]) / fx
    cy, sy, cp, sp = np.cos(p[3]), np.sin(p[3]), np.cos(p[4]), -np.sin(p[4])
    root, widest, tip = shape[0] * np.exp(p[8]), shape[1] * np.exp(p[7]), shape[2] * np.exp(p[9])
    stout = np.exp(p[11])
    cc, sc = np.cos(cone), np.sin(cone)
    for b in range(3):
        ca, sa = np.cos(p[2] + b * 2 * np.pi / 3), np.sin(p[2] + b * 2 * np.pi / 3)
        # Columns of the rotor's axes: (cy cp, sy cp, -sp), (-sy, cy, 0), (cy sp, sy sp, cp).
        ex, ey, ez = -ca * sy + sa * cy * sp, ca * cy + sa * sy * sp, sa * cp  # outward in the rotor's plane
        ax, ay, az = ca * cy * sp + sa * sy, ca * sy * sp - sa * cy, ca * cp  # clockwise
        lx, ly, lz = cc * ex - sc * cy * cp, cc * ey - sc * sy * cp, cc * ez + sc * sp
        dx, dy, dz = cc * cy * cp + sc * ex, cc * sy * cp + sc * ey, -cc * sp + sc * ez
        for k in range(len(table)):
            station = table[k, 0]
            chord = root + table[k, 1] * (widest - root) + table[k, 2] * (tip - widest)
            thick = chord * (1.0 + (table[k, 3] * stout - 1.0) * table[k, 1])
            ct, st = np.cos(p[5] + table[k, 5]), np.sin(p[5] + table[k, 5])
            r = station * radius
            x, y, z = hx + r * lx, hy + r * ly, hz + r * lz
            nx, ny, nz = y * lz - z * ly, z * lx - x * lz, x * ly - y * lx
            size = np.sqrt(nx * nx + ny * ny + nz * nz)
            nx, ny, nz = nx / size, ny / size, nz / size
            across, deep = ax * nx + ay * ny + az * nz, dx * nx + dy * ny + dz * nz
            forward, back = ct * across - st * deep, st * across + ct * deep
            axis = table[k, 4] + p[10] * table[k, 1]
            nose = 0.5 - (0.5 - THICKEST) * table[k, 1]
            middle, end = (axis - nose) * chord, (axis - 1.0) * chord  # ahead of the blade's axis
            half = np.sqrt((nose * chord * forward) ** 2 + (0.5 * thick * back) ** 2)
            qx, qy, qz = ct * ax - st * dx, ct * ay - st * dy, ct * az - st * dz  # along the chord, forward
            for s in range(2):
                side = half if s == 0 else -half
                ahead = middle
                if (s == 0) == (end * forward > middle * forward + side):
                    ahead, side = end, 0.0
                depth = x + radius * (ahead * qx + side * nx)
                points[b, s, k, 0] = fx * (y + radius * (ahead * qy + side * ny)) / depth + lens[2]
                points[b, s, k, 1] = fy * (z + radius * (ahead * qz + side * nz)) / depth + lens[3]


@compiled
def traces(many: Array, table: Array, cone: float, shape: Array, lens: Array) -> Array:
    """`trace` of rotors (k, 12): (k, 3, 2, n, 2)."""
    points = np.empty((len(many), 3, 2, len(table), 2))
    for i in range(len(many)):
        trace(many[i], table, cone, shape, lens, points[i])
    return points


@compiled
def agreements(
    many: Array, table: Array, cone: float, shape: Array, lens: Array, gradient: Array, soft: float
) -> Array:
    """(k, 2): the share of the six edges of rotors (k, 12) on which the picture changes across them, and by how many px
    of them it does so beyond chance.

    gradient (h, w, 2) float32: of the picture, right and down, grey levels a pixel; soft: the step that counts fully.
    """
    height, width = gradient.shape[0], gradient.shape[1]
    n = len(table)
    points = np.empty((3, 2, n, 2))
    result = np.empty((len(many), 2))
    for i in range(len(many)):
        trace(many[i], table, cone, shape, lens, points)
        total, beyond = 0.0, 0.0
        for b in range(3):
            for s in range(2):
                here, inside = 0.0, 0
                for k in range(n):
                    u = int(np.floor(points[b, s, k, 0] + (width - 1) / 2 + 0.5))
                    v = int(np.floor(points[b, s, k, 1] + (height - 1) / 2 + 0.5))
                    if u < 2 or v < 2 or u >= width - 2 or v >= height - 2:
                        continue
                    first, last = max(k - 1, 0), min(k + 1, n - 1)
                    dx = points[b, s, last, 0] - points[b, s, first, 0]
                    dy = points[b, s, last, 1] - points[b, s, first, 1]
                    length = np.sqrt(dx * dx + dy * dy) + 1e-9
                    gx, gy = gradient[v, u, 0], gradient[v, u, 1]
                    across, along = abs(gy * dx - gx * dy) / length, abs(gx * dx + gy * dy) / length
                    step = min(max((across - 0.5 * along) / soft, 0.0), 1.0)
                    here += step
                    beyond += (step - CHANCE) * length / (last - first)
                    inside += 1
                # An edge that hardly enters the picture says little, and as little as it says it may count.
                total += here / max(inside, n / 5)
        result[i, 0], result[i, 1] = total / 6, beyond
    return result
