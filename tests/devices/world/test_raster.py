"""The drawn world against an independent ray caster."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from devices.world.renderer import Renderer
from devices.world.settings import WorldSettings
from devices.world.true_view import true_view
from devices.world.turbine import TurbineShape
from vision.camera import Camera, RigGeometry, StereoPair
from vision.capture import CameraPose, rotation_of

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("embreex")

CAMERA = Camera(306, 256, 308.0, 308.0, 152.5, 127.5)
GEOMETRY = RigGeometry(StereoPair(CAMERA, CAMERA, translation=np.array([0.0, -0.2, 0.0])))

# azimuth of the blade, station, distance, sideways, camera pitch and yaw off the turbine's heading in degrees
VIEWS = {
    "middle of a blade": (45.0, 20.0, 3.0, 0.0, 0.0, 0.0),
    "tip": (45.0, 39.4, 3.0, 0.1, 5.0, -8.0),
    "root with the spinner": (300.0, 2.5, 3.0, 0.4, -10.0, 12.0),
    "blade down before the tower": (180.0, 24.0, 4.0, 0.0, 0.0, 3.0),
    "rotor from afar": (20.0, 0.0, 45.0, 0.0, 0.0, 0.0),
    "rotor from below": (20.0, 5.0, 30.0, 10.0, 20.0, 15.0),
}


@pytest.fixture(scope="module")
def settings() -> WorldSettings:
    return WorldSettings()


@pytest.mark.parametrize("name", VIEWS)
def test_silhouette_lies_within_a_pixel_and_depth_within_a_millimetre_of_ray_casting(name, settings):
    azimuth, station, distance, sideways, pitch, yaw = VIEWS[name]
    shape = TurbineShape(azimuth_deg=azimuth, heading_deg=8.0, north_m=60.0, east_m=10.0)
    heading = np.deg2rad(shape.heading_deg + yaw)
    pose = CameraPose(
        shape.blade_frame().to_ned(np.array([station, sideways, -distance])),
        rotation_of(0.0, np.deg2rad(pitch), heading),
    )
    view = true_view(Renderer(shape, settings), GEOMETRY, pose)

    mesh = shape.mesh
    caster = trimesh.ray.ray_pyembree.RayMeshIntersector(trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False))
    v, u = np.mgrid[0 : CAMERA.height, 0 : CAMERA.width]
    rays = CAMERA.rays(np.column_stack([u.ravel(), v.ravel()]))
    unit = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    origins = np.broadcast_to(pose.position, unit.shape)
    triangle, ray, where = caster.intersects_id(
        origins, unit @ pose.rotation.T, multiple_hits=False, return_locations=True
    )
    depth = np.full(u.size, np.inf)
    depth[ray] = pose.from_ned(where)[:, 0]
    depth = depth.reshape(u.shape)
    part = np.zeros(u.size, np.uint8)
    part[ray] = mesh.part[triangle]
    part = part.reshape(u.shape)

    assert 0.02 < np.isfinite(depth).mean() < 0.98
    for number in np.unique(part):
        ours, theirs = view.part == number, part == number
        cross = np.ones((3, 3), bool)
        assert not (ours & ~binary_dilation(theirs, cross)).any(), f"part {number} is drawn more than a pixel too wide"
        assert not (theirs & ~binary_dilation(ours, cross)).any(), (
            f"part {number} is drawn more than a pixel too narrow"
        )
    assert (view.part != part).mean() < 0.002
    both = (view.part == part) & np.isfinite(depth)
    error = np.abs(view.depth[both] - depth[both])
    assert np.quantile(error, 0.999) < 1e-3
    # What is left are single pixels in which the two see different sheets of the same part, at its outline.
    assert (error > 1e-3).mean() < 1e-3
