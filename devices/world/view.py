"""Pictures of the simulated world from one pose: four images of a cycle, and what is truly in them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.world import raster
from devices.world.background import background, surroundings
from devices.world.raycast import cast, hidden
from devices.world.sensor import Sensor, add_spots
from devices.world.settings import WorldSettings
from devices.world.silhouette import edges, outlines
from devices.world.skin import lit, skins
from devices.world.turbine import BLADES, INSPECTED, SKY, TurbineShape
from vision.camera import Camera, RigGeometry
from vision.capture import CameraPose, Image, StereoFrames
from vision.observation import Dots

Array = NDArray[np.float64]

LASER_REACH_M = 40.0
SPOT_GREY = 230.0  # amplitude of a spot met head-on at SPOT_AT_M
SPOT_AT_M = 3.0
SPOT_FALL = 1.5  # power of the distance with which spots fade
SPOT_RAD = 1.5 / 616.0  # standard deviation of a spot as seen from SPOT_AT_M


@dataclass(frozen=True)
class Spots:
    """Where the laser's rays meet the turbine: points (n, 3) in local NED, the part each lies on, its row and column
    in the grid, and the cosine between ray and surface."""

    points: Array
    part: NDArray[np.uint8]
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    cosine: Array


@dataclass(frozen=True)
class TrueView:
    """What is truly in the images of one pose; pixels are of the full image, as drawn (distorted where the lens is).

    part (h, w): of devices.world.turbine, SKY where nothing; depth (h, w) m along the optical axis of the left camera,
    inf where nothing. dots_left, dots_right: every laser spot that the eye can see inside its image; spot_part: the
    part that the left ones lie on. leading, trailing (n, 2): the inspected blade's edges in the left image from root
    to tip, NaN behind the lens. hub, tip (2,): pixels of the hub's centre and of the inspected blade's outermost
    point. azimuths (3,): directions of the three blades in the left image, radians clockwise from +y_im, the inspected
    one first."""

    part: NDArray[np.uint8]
    depth: NDArray[np.float32]
    dots_left: Dots
    dots_right: Dots
    spot_part: NDArray[np.uint8]
    leading: Array
    trailing: Array
    hub: Array
    tip: Array
    azimuths: Array


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
        self._lenses: dict[Camera, _Distortion] = {}

    def visibility(
        self, camera: Camera, pose: CameraPose, factor: int = 1
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """1/depth and triangle, -1 for none, of every sample of a pinhole, `factor` samples a pixel each way. Valid
        until the next call."""
        height, width = camera.height * factor, camera.width * factor
        if (height, width) not in self._buffers:
            self._buffers[height, width] = np.empty((height, width), np.float32), np.empty((height, width), np.int32)
        inverse, seen = self._buffers[height, width]
        lens = _lens(camera, factor)
        mesh = self.mesh
        rotation, position = np.ascontiguousarray(pose.rotation), np.ascontiguousarray(pose.position)
        raster.transform(mesh.vertices, rotation, position, self._points)
        clusters = raster.visible_clusters(mesh.centre, mesh.radius, rotation, position, lens, width, height)
        raster.visibility(self._points, mesh.triangles, mesh.start, clusters, lens, inverse, seen)
        return inverse, seen

    def scenery(self, camera: Camera, pose: CameraPose) -> Image:
        """One image (h, w, 3) BGR without laser, vignette and noise, distorted as the camera's lens is."""
        lens = self._distortion(camera)
        pinhole = camera if lens is None else lens.pinhole
        settings = self.settings
        inverse, seen = self.visibility(pinhole, pose, 2 if settings.camera.antialias else 1)
        self._seen = seen
        image = background(
            self._tiles,
            (pinhole.width, pinhole.height),
            _lens(pinhole),
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
            _lens(pinhole),
            inverse,
            seen,
            dressed.dirt,
            dressed.layout,
            dressed.tint,
            image,
        )
        return image if lens is None else lens.bend(image)

    def spots(self, geometry: RigGeometry, pose: CameraPose) -> Spots:
        """Where the laser's rays end on the turbine within its reach."""
        if geometry.laser is None:
            raise ValueError("this rig has no laser")
        directions = geometry.laser.directions()
        columns = directions.shape[1]
        rays = directions.reshape(-1, 3) @ pose.rotation.T
        origin = pose.to_ned(geometry.laser.position)
        distance, triangle = cast(self.mesh, origin, rays, LASER_REACH_M)
        met = np.flatnonzero(triangle >= 0)
        corners = self.mesh.vertices[self.mesh.triangles[triangle[met]]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        return Spots(
            origin + rays[met] * distance[met, None],
            self.mesh.part[triangle[met]],
            met // columns,
            met % columns,
            np.abs(np.einsum("ij,ij->i", normal, rays[met])),
        )

    def seen_spots(self, spots: Spots, camera: Camera, pose: CameraPose) -> tuple[Array, NDArray[np.int64]]:
        """Pixels (n, 2) of those spots that a camera sees inside its image, and which spots they are (n,)."""
        if len(spots.points) == 0:
            return np.empty((0, 2)), np.empty(0, np.int64)
        pixels = camera.project(pose.from_ned(spots.points))
        with np.errstate(invalid="ignore"):
            inside = np.all((pixels >= -0.5) & (pixels < [camera.width - 0.5, camera.height - 0.5]), axis=1)
        which = np.flatnonzero(inside)
        which = which[~hidden(self.mesh, pose.position, spots.points[which])]
        return pixels[which], which

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
        pixels, which = self.seen_spots(spots, camera, pose)
        distance = np.linalg.norm(spots.points[which] - pose.position, axis=1)
        share = np.maximum(distance, 0.5) / SPOT_AT_M
        albedo = self._skins.tint[spots.part[which], 1] / 150.0
        amplitude = SPOT_GREY * albedo * share**-SPOT_FALL * np.sqrt(spots.cosine[which])
        sigma = np.maximum(camera.fx * SPOT_RAD * share**-0.5, 0.6)
        streak = np.full(len(which), self.settings.camera.streak_px * camera.width / 612.0)
        seen = self._seen if self._distortion(camera) is None else np.empty((0, 0), np.int32)
        whole = np.round(shift).astype(np.int64)
        add_spots(image, pixels, amplitude, sigma, streak, spots.part[which], seen, self.mesh.part, whole)

    def sensor(self, camera: Camera) -> Sensor:
        """The sensor of a camera of this size."""
        size = (camera.width, camera.height)
        if size not in self._sensors:
            self._sensors[size] = Sensor(*size, self.settings.camera, self.settings.seed)
        return self._sensors[size]

    def _distortion(self, camera: Camera) -> _Distortion | None:
        if not any(camera.distortion):
            return None
        if camera not in self._lenses:
            self._lenses[camera] = _Distortion(camera)
        return self._lenses[camera]

    def truth(self, geometry: RigGeometry, pose: CameraPose) -> TrueView:
        """What is truly in the images of a pose."""
        camera = geometry.stereo.left
        lens = self._distortion(camera)
        inverse, seen = self.visibility(camera if lens is None else lens.pinhole, pose)
        if lens is not None:
            inverse, seen = lens.bend(inverse, cv2.INTER_NEAREST), lens.bend(seen, cv2.INTER_NEAREST)
        part = np.where(seen >= 0, self.mesh.part[np.maximum(seen, 0)], SKY).astype(np.uint8)
        with np.errstate(divide="ignore"):
            depth = np.where(seen >= 0, 1 / inverse, np.inf).astype(np.float32)
        dots = [Dots(np.empty((0, 2)), np.empty(0, np.int64), np.empty(0, np.int64))] * 2
        spot_part = np.empty(0, np.uint8)
        if geometry.laser is not None:
            spots = self.spots(geometry, pose)
            for eye, (own, place) in enumerate(((camera, pose), (geometry.stereo.right, right_pose(geometry, pose)))):
                pixels, which = self.seen_spots(spots, own, place)
                dots[eye] = Dots(pixels, spots.row[which], spots.column[which])
                if eye == 0:
                    spot_part = spots.part[which]
        stations = np.linspace(self.shape.visible_root_m, self.shape.blade.tip_radius_m, 400)
        outline = outlines(self.shape, stations)
        leading, trailing = (edges(self.shape, outline, camera, pose, side)[0] for side in ("leading", "trailing"))
        frames = [self.shape.blade_frame(number) for number in range(len(BLADES))]
        hub = camera.project(pose.from_ned(self.shape.hub))[0]
        # A blade's image is a straight line through the hub's: its direction comes from a point close to the hub.
        near = camera.project(pose.from_ned(np.array([frame.to_ned(np.array([5.0, 0.0, 0.0])) for frame in frames])))
        azimuths = np.arctan2(near[:, 1] - hub[1], near[:, 0] - hub[0])
        tip = camera.project(pose.from_ned(self.shape.tip_point))[0]
        return TrueView(part, depth, dots[0], dots[1], spot_part, leading, trailing, hub, tip, azimuths)


class _Distortion:
    """A wider pinhole view and how to bend it into what the distorted lens sees."""

    def __init__(self, camera: Camera) -> None:
        v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
        rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
        self.u = (camera.fx * rays[:, 1] + camera.cx).reshape(u.shape)
        self.v = (camera.fy * rays[:, 2] + camera.cy).reshape(v.shape)
        left, top = max(int(np.ceil(-self.u.min())) + 2, 0), max(int(np.ceil(-self.v.min())) + 2, 0)
        self.u, self.v = (self.u + left).astype(np.float32), (self.v + top).astype(np.float32)
        self.pinhole = Camera(
            int(np.ceil(self.u.max())) + 3,
            int(np.ceil(self.v.max())) + 3,
            camera.fx,
            camera.fy,
            camera.cx + left,
            camera.cy + top,
        )

    def bend(self, image: NDArray, how: int = cv2.INTER_LINEAR) -> NDArray:  # type: ignore[type-arg]
        """The distorted image of a pinhole image."""
        kind = image.dtype
        flat = image.astype(np.float32) if kind == np.int32 else image  # triangles are few enough to be exact
        return np.asarray(cv2.remap(flat, self.u, self.v, how, borderMode=cv2.BORDER_CONSTANT), kind)


def _lens(camera: Camera, factor: int = 1) -> Array:
    """fx, fy, cx, cy (4,) of a pinhole with `factor` samples a pixel each way."""
    centre = (np.array([camera.cx, camera.cy]) + 0.5) * factor - 0.5
    return np.array([camera.fx * factor, camera.fy * factor, *centre])


def right_pose(geometry: RigGeometry, pose: CameraPose) -> CameraPose:
    """Pose of the right camera where the left one's is `pose`."""
    stereo = geometry.stereo
    return CameraPose(
        pose.to_ned(-stereo.rotation.T @ stereo.translation), pose.rotation @ stereo.rotation.T, pose.sigma_m
    )


def draw(
    renderer: Renderer,
    geometry: RigGeometry,
    pose: CameraPose,
    *,
    laser: bool = True,
    lit: bool = True,
    stamp_s: float = 0.0,
    frame: int = 0,
    shift: tuple[float, float] = (0.0, 0.0),
) -> StereoFrames:
    """Four images, two without `laser`, from the left camera's true pose. Two draws serve all four.

    lit: whether the laser shines in its images; a broken one does not. frame: number of the cycle, which chooses the
    noise. shift: by how many pixels the scene moves between the laser-off and the laser-on exposure; the spots move
    with the camera and stay where they are."""
    images: list[Image | None] = []
    both = laser and geometry.laser is not None
    spots = renderer.spots(geometry, pose) if both and lit else None
    blur = renderer.settings.camera.motion_blur
    for eye, camera in enumerate((geometry.stereo.left, geometry.stereo.right)):
        place = pose if eye == 0 else right_pose(geometry, pose)
        sensor = renderer.sensor(camera)
        off = smeared(sensor.darkened(renderer.scenery(camera, place)), (shift[0] * blur, shift[1] * blur))
        on = None
        if both:
            on = moved(off, shift)
            if spots is not None:
                renderer.add_laser(on, spots, camera, place, shift)
            on = sensor.exposed(on, 4 * frame + 2 + eye)
        images += [sensor.exposed(off, 4 * frame + eye), on]
    return StereoFrames(stamp_s, images[0], images[2], images[1], images[3])


def moved(image: Image, shift: tuple[float, float]) -> Image:
    """A copy of an image, its content moved by so many pixels right and down."""
    if max(abs(shift[0]), abs(shift[1])) < 0.02:
        return image.copy()
    height, width = image.shape[:2]
    right, down = int(np.floor(shift[0])), int(np.floor(shift[1]))
    across, along = np.array([shift[0] - right, 1 - shift[0] + right]), np.array([shift[1] - down, 1 - shift[1] + down])
    soft = cv2.sepFilter2D(image, -1, across, along, anchor=(1, 1), borderType=cv2.BORDER_REPLICATE)
    right, down = int(np.clip(right, 1 - width, width - 1)), int(np.clip(down, 1 - height, height - 1))
    kept = soft[max(-down, 0) : height - max(down, 0), max(-right, 0) : width - max(right, 0)]
    sides = (max(down, 0), max(-down, 0), max(right, 0), max(-right, 0))
    return np.asarray(cv2.copyMakeBorder(kept, *sides, cv2.BORDER_REPLICATE), np.uint8)


def smeared(image: Image, path: tuple[float, float]) -> Image:
    """An image blurred along a path of so many pixels right and down, as by motion during the exposure."""
    length = float(np.hypot(*path))
    if length < 0.3:
        return image
    half = int(np.ceil(length / 2))
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    for share in np.linspace(-0.5, 0.5, 8 * half + 1):
        u, v = half + share * path[0], half + share * path[1]
        i, j = int(v), int(u)
        for di, dj in ((0, 0), (0, 1), (1, 0), (1, 1)):
            if i + di <= 2 * half and j + dj <= 2 * half:
                kernel[i + di, j + dj] += (1 - abs(v - i - di)) * (1 - abs(u - j - dj))
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE), np.uint8)


def render_view(
    shape: TurbineShape, settings: WorldSettings, geometry: RigGeometry, pose: CameraPose, laser: bool = True
) -> tuple[StereoFrames, TrueView]:
    """The images from one pose and what is truly in them. For many poses keep a `Renderer` and call `draw` and its
    `truth`."""
    renderer = Renderer(shape, settings)
    return draw(renderer, geometry, pose, laser=laser), renderer.truth(geometry, pose)


__all__ = ["INSPECTED", "Renderer", "Spots", "TrueView", "draw", "render_view", "right_pose"]
