"""Draws what one camera sees of the simulated world."""

from __future__ import annotations

from copy import copy
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from devices.world import raster
from devices.world.background import background, surroundings
from devices.world.laser import Spots, seen_spots
from devices.world.lens import Distortion, lens_of
from devices.world.raycast import cast
from devices.world.sensor import Sensor, add_spots
from devices.world.settings import WorldSettings
from devices.world.skin import lit, skins
from devices.world.turbine import TurbineShape
from vision.camera import Camera
from vision.capture import CameraPose, Image

Array = NDArray[np.float64]


SPOT_GREY = 230.0  # amplitude of a spot met head-on at SPOT_AT_M
SPOT_AT_M = 3.0
SPOT_FALL = 1.5  # power of the distance with which spots fade
SPOT_RAD = 1.5 / 616.0  # standard deviation of a spot as seen from SPOT_AT_M


class Renderer:
    """Draws one turbine under one setting of the world. Not for two threads at once: buffers are kept between
    images."""

    def __init__(self, shape: TurbineShape, settings: WorldSettings) -> None:
        self.shape = shape
        self.settings = settings
        mesh = shape.mesh
        self.mesh = mesh
        self._skins = skins(shape, settings.blade, settings.light, settings.camera.exposure, settings.seed)
        self._attributes = np.column_stack([lit(mesh.normals, settings.light), mesh.skin]).astype(np.float64)
        self._tiles = surroundings(settings.light, settings.seed)
        self._points = np.empty_like(mesh.vertices)
        self._buffers: dict[tuple[int, int], tuple[NDArray[np.float32], NDArray[np.int32]]] = {}
        self._seen = np.empty((0, 0), np.int32)
        self._sensors: dict[tuple[int, int], Sensor] = {}
        self._lenses: dict[Camera, Distortion] = {}

    @cached_property
    def second(self) -> Renderer:
        """Another renderer of the same world with buffers of its own, for a second thread."""
        twin = copy(self)
        twin._points = np.empty_like(self.mesh.vertices)
        twin._buffers = {}
        twin._seen = np.empty((0, 0), np.int32)
        return twin

    def visibility(
        self, camera: Camera, pose: CameraPose, factor: int = 1
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """1/depth and triangle, -1 for none, of every sample of a pinhole, `factor` samples a pixel each way. Valid
        until the next call."""
        height, width = camera.height * factor, camera.width * factor
        if (height, width) not in self._buffers:
            self._buffers[height, width] = np.empty((height, width), np.float32), np.empty((height, width), np.int32)
        inverse, seen = self._buffers[height, width]
        lens = lens_of(camera, factor)
        mesh = self.mesh
        rotation, position = np.ascontiguousarray(pose.rotation), np.ascontiguousarray(pose.position)
        raster.transform(mesh.vertices, rotation, position, self._points)
        clusters = raster.visible_clusters(mesh.centre, mesh.radius, rotation, position, lens, width, height)
        raster.visibility(self._points, mesh.triangles, mesh.start, clusters, lens, inverse, seen)
        return inverse, seen

    def scenery(self, camera: Camera, pose: CameraPose) -> Image:
        """One image (h, w, 3) BGR without laser, vignette and noise, distorted as the camera's lens is."""
        lens = self.distortion(camera)
        pinhole = camera if lens is None else lens.pinhole
        settings = self.settings
        inverse, seen = self.visibility(pinhole, pose, 2 if settings.camera.antialias else 1)
        self._seen = seen
        image = background(
            self._tiles,
            (pinhole.width, pinhole.height),
            lens_of(pinhole),
            np.ascontiguousarray(pose.rotation),
            np.ascontiguousarray(pose.position),
            -self.shape.ground_m,
            settings.camera.exposure,
            seen,
        )
        dressed = self._skins
        raster.shade(
            self._points,
            self.mesh.triangles,
            self.mesh.part,
            self._attributes,
            lens_of(pinhole),
            inverse,
            seen,
            dressed.dirt,
            dressed.layout,
            dressed.tint,
            image,
        )
        return image if lens is None else lens.bend(image)

    def distance_ahead(self, pose: CameraPose) -> float:
        """Metres along the optical axis to the nearest of nine points about the image's middle; 60 where nothing is
        met."""
        side = np.linspace(-0.15, 0.15, 3)
        rays = np.array([[1.0, y, z] for y in side for z in side])
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        distance, _ = cast(self.mesh, pose.position, rays @ pose.rotation.T, 60.0)
        return float(np.median(distance) if np.median(distance) < 60 else distance.min())

    def add_laser(
        self, image: Image, spots: Spots, camera: Camera, pose: CameraPose, shift: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        """Draw the spots that this camera sees into its image (h, w, 3), the last that `scenery` drew, moved since then
        by so many pixels right and down."""
        pixels, which = seen_spots(self.mesh, spots, camera, pose)
        distance = np.linalg.norm(spots.points[which] - pose.position, axis=1)
        share = np.maximum(distance, 0.5) / SPOT_AT_M
        albedo = self._skins.tint[spots.part[which], 1] / 150.0
        amplitude = SPOT_GREY * albedo * share**-SPOT_FALL * np.sqrt(spots.cosine[which])
        sigma = np.maximum(camera.fx * SPOT_RAD * share**-0.5, 0.6)
        streak = np.full(len(which), self.settings.camera.streak_px * camera.width / 612.0)
        seen = self._seen if self.distortion(camera) is None else np.empty((0, 0), np.int32)
        whole = np.round(shift).astype(np.int64)
        add_spots(image, pixels, amplitude, sigma, streak, spots.part[which], seen, self.mesh.part, whole)

    def sensor(self, camera: Camera) -> Sensor:
        """The sensor of a camera of this size."""
        size = (camera.width, camera.height)
        if size not in self._sensors:
            self._sensors[size] = Sensor(*size, self.settings.camera, self.settings.seed)
        return self._sensors[size]

    def distortion(self, camera: Camera) -> Distortion | None:
        """The bending of a camera's lens; None for a pinhole."""
        if not camera.bends:
            return None
        if camera not in self._lenses:
            self._lenses[camera] = Distortion(camera)
        return self._lenses[camera]
