"""Where a laser whose grid is not known throws dots besides those that are seen: it has at least so many rows and
columns, and those that are seen are some of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vision.lattice import Lattice

Array = NDArray[Any]  # of floats

USUAL = 11  # rows and columns of a laser, unless more are seen
AROUND = 3  # rows and columns beyond those seen that are reckoned with: so far the lattice can be continued
NEAREST = 9  # dots that a place is reckoned from
TAKEN = 0.25  # of the spacing: a spot so near to a place leaves open whether it is its dot


@dataclass(frozen=True)
class Fan:
    """Places without dots, row and column (m, 2) in the lattice's count, where they are in the image, (m, 2) px, and
    how many rows and columns the lattice has and the laser is taken to have."""

    place: NDArray[np.int64]
    uv: Array
    seen: tuple[int, int]
    size: tuple[int, int]

    def certain(self) -> NDArray[np.bool_]:
        """Which places (m,) lie in rows and columns that have dots."""
        return np.asarray(((self.place >= 0) & (self.place < self.seen)).all(axis=1))

    def central(self, middle: Array) -> NDArray[np.bool_]:
        """Which places (m,) the laser reaches if the middle of its grid is as near as may be to a place (2,), in rows
        and columns."""
        first = np.array(
            [
                np.clip(round(float(middle[k]) - (self.size[k] - 1) / 2), self.seen[k] - self.size[k], 0)
                for k in range(2)
            ]
        )
        return np.asarray(((self.place >= first) & (self.place < first + self.size)).all(axis=1))

    def least_missing(self, inside: NDArray[np.bool_]) -> int:
        """How many of some places (m,) lack their dot, however the seen rows and columns lie in the laser's grid."""
        place = self.place[inside]
        starts = [range(self.seen[k] - self.size[k], 1) for k in range(2)]
        return min(
            int(((place >= (r, c)) & (place < (r + self.size[0], c + self.size[1]))).all(axis=1).sum())
            for r in starts[0]
            for c in starts[1]
        )


def fan_of(uv: Array, lattice: Lattice) -> Fan:
    """The fan that the lattice of some of the spots (n, 2) belongs to."""
    rows, columns = int(lattice.row.max()) + 1, int(lattice.column.max()) + 1
    own, dots = np.column_stack([lattice.row, lattice.column]), uv[lattice.member]
    r, c = np.mgrid[-AROUND : rows + AROUND, -AROUND : columns + AROUND]
    taken = np.zeros(r.shape, bool)
    taken[own[:, 0] + AROUND, own[:, 1] + AROUND] = True
    place = np.column_stack([r[~taken], c[~taken]])
    where = np.array([_continued(one, own, dots, lattice.steps) for one in place]).reshape(-1, 2)
    others = np.delete(uv, lattice.member, axis=0)
    if len(others) and len(where):
        apart = np.hypot(*(where[:, None] - others).transpose(2, 0, 1)).min(axis=1)
        free = apart > TAKEN * lattice.spacing
        place, where = place[free], where[free]
    size = max(USUAL, rows, columns)
    return Fan(place, where, (rows, columns), (size, size))


def middle_place(uv: Array, lattice: Lattice, point: Array) -> Array:
    """Row and column (2,), not whole, of a point (2,) of the image, as a plane through the whole lattice has it."""
    own = np.column_stack([lattice.row, lattice.column]).astype(float)
    design = np.column_stack([np.ones(len(own)), own])
    fit = np.linalg.lstsq(design, uv[lattice.member], rcond=None)[0]
    return np.asarray(np.linalg.lstsq(fit[1:].T, point - fit[0], rcond=None)[0])


def _continued(place: Array, own: Array, dots: Array, steps: Array) -> Array:
    """Where a place is (2,) px: on a plane through the nearest dots, which may lead far, where a curve would lead
    astray."""
    here = own - place
    near = np.argsort(here[:, 0] ** 2 + here[:, 1] ** 2, kind="stable")[:NEAREST]
    design = np.column_stack([np.ones(len(near)), here[near, 1], here[near, 0]])
    known = np.vstack([np.zeros(2), steps])
    held = np.diag([0.0, 1.0, 1.0])
    return np.asarray(np.linalg.solve(design.T @ design + held, design.T @ dots[near] + held @ known)[0])
