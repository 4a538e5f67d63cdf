"""The laser's spots: where its rays meet the turbine, and who sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from devices.world.mesh import Mesh
from devices.world.raycast import cast, hidden
from vision.camera import Camera, RigGeometry
from vision.capture import CameraPose

Array = NDArray[np.float64]


LASER_REACH_M = 40.0


@dataclass(frozen=True)
class Spots:
    """Where the laser's rays meet the turbine: points (n, 3) in local NED, the part each lies on, its row and column
    in the grid, and the cosine between ray and surface."""

    points: Array
    part: NDArray[np.uint8]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    cosine: Array


def spots_on(mesh: Mesh, geometry: RigGeometry, pose: CameraPose) -> Spots:
    """Where the laser's rays end on the turbine within its reach."""
    if geometry.laser is None:
        raise ValueError("this rig has no laser")
    directions = geometry.laser.directions()
    columns = directions.shape[1]
    rays = directions.reshape(-1, 3) @ pose.rotation.T
    origin = pose.to_ned(geometry.laser.position)
    distance, triangle = cast(mesh, origin, rays, LASER_REACH_M)
    met = np.flatnonzero(triangle >= 0)
    corners = mesh.vertices[mesh.triangles[triangle[met]]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Spots(
        origin + rays[met] * distance[met, None],
        mesh.part[triangle[met]],
        met // columns,
        met % columns,
        np.abs(np.einsum("ij,ij->i", normal, rays[met])),
    )


def seen_spots(mesh: Mesh, spots: Spots, camera: Camera, pose: CameraPose) -> tuple[Array, NDArray[np.int64]]:
    """Pixels (n, 2) of those spots that a camera sees inside its image, and which spots they are (n,)."""
    if len(spots.points) == 0:
        return np.empty((0, 2)), np.empty(0, np.int64)
    pixels = camera.project(pose.from_ned(spots.points))
    with np.errstate(invalid="ignore"):
        inside = np.all((pixels >= -0.5) & (pixels < [camera.width - 0.5, camera.height - 0.5]), axis=1)
    which = np.flatnonzero(inside)
    which = which[~hidden(mesh, pose.position, spots.points[which])]
    return pixels[which], which
