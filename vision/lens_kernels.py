"""Inner loops over the pixels whose rays a bending lens is asked for: the inverse of what `vision.camera` projects."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.compiled import compiled

Floats = NDArray[Any]

STEPS, HALVINGS, ENOUGH = 40, 12, 1e-13  # ENOUGH: of the focal length, far below what a double's pixel resolves
WIDEST = 1.45  # rad off the axis: further out nothing is seen that matters


@compiled
def unbent_radtan(bent: Floats, distortion: Floats, straight: Floats) -> None:
    """The places (n, 2), in focal lengths from the optical axis, that the radial-tangential lens (k1, k2, p1, p2) bends
    to the places `bent` (n, 2); where it bends none there, one near where it begins to fold. By Newton's method, its
    steps halved until they gain."""
    k1, k2, p1, p2 = distortion
    for k in range(len(bent)):
        y, z = step_y, step_z = bent[k, 0], bent[k, 1]
        last = np.inf
        for _ in range(STEPS):
            for _ in range(HALVINGS):
                r2 = y * y + z * z
                radial, slope = 1 + r2 * (k1 + k2 * r2), 2 * (k1 + 2 * k2 * r2)
                off_y = y * radial + 2 * p1 * y * z + p2 * (r2 + 2 * y * y) - bent[k, 0]
                off_z = z * radial + p1 * (r2 + 2 * z * z) + 2 * p2 * y * z - bent[k, 1]
                yy = radial + slope * y * y + 2 * p1 * z + 6 * p2 * y
                yz = slope * y * z + 2 * p1 * y + 2 * p2 * z
                zz = radial + slope * z * z + 6 * p1 * z + 2 * p2 * y
                off, area = off_y * off_y + off_z * off_z, yy * zz - yz * yz
                if off < last and area > 0 and yy > 0:  # both less than nothing: turned inside out, beyond the fold
                    break
                step_y, step_z = 0.5 * step_y, 0.5 * step_z
                y, z = y - step_y, z - step_z
            if not (off < last and area > 0 and yy > 0):
                y, z = y - step_y, z - step_z
                break
            if off < ENOUGH * ENOUGH:
                break
            last = off
            step_y, step_z = (yz * off_z - zz * off_y) / area, (yz * off_y - yy * off_z) / area
            y, z = y + step_y, z + step_z
        straight[k, 0], straight[k, 1] = y, z


@compiled
def unbent_equidistant(bent: Floats, distortion: Floats, straight: Floats) -> None:
    """The same for the equidistant lens (k1, k2, k3, k4), whose angle off the axis is found by Newton's method."""
    k1, k2, k3, k4 = distortion
    for k in range(len(bent)):
        wanted = np.hypot(bent[k, 0], bent[k, 1])
        if wanted < 1e-12:
            straight[k] = bent[k]
            continue
        low, high = 0.0, WIDEST
        angle = min(wanted, WIDEST)
        for _ in range(STEPS):
            s = angle * angle
            off = angle * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4)))) - wanted
            if off > 0:
                high = angle
            else:
                low = angle
            if abs(off) < ENOUGH:
                break
            slope = 1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4)))
            angle = angle - off / slope if slope > 0 else high
            if not low < angle < high:
                angle = 0.5 * (low + high)
        straight[k] = bent[k] * (np.tan(angle) / wanted)
