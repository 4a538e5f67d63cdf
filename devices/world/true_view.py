"""What is truly in the images of one pose."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from devices.world.laser import seen_spots, spots_on
from devices.world.lens import right_pose
from devices.world.renderer import Renderer
from devices.world.silhouette import edges, outlines
from devices.world.turbine import BLADES, SKY
from vision.camera import RigGeometry
from vision.capture import CameraPose
from vision.observation import Dots

Array = NDArray[np.float64]


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


def true_view(renderer: Renderer, geometry: RigGeometry, pose: CameraPose) -> TrueView:
    """What is truly in the images of a pose."""
    camera = geometry.stereo.left
    lens = renderer.distortion(camera)
    inverse, seen = renderer.visibility(camera if lens is None else lens.pinhole, pose)
    if lens is not None:
        inverse, seen = lens.bend(inverse, cv2.INTER_NEAREST), lens.bend(seen, cv2.INTER_NEAREST)
    part = np.where(seen >= 0, renderer.mesh.part[np.maximum(seen, 0)], SKY).astype(np.uint8)
    with np.errstate(divide="ignore"):
        depth = np.where(seen >= 0, 1 / inverse, np.inf).astype(np.float32)
    dots = [Dots(np.empty((0, 2)), np.empty(0, np.int64), np.empty(0, np.int64))] * 2
    spot_part = np.empty(0, np.uint8)
    if geometry.laser is not None:
        spots = spots_on(renderer.mesh, geometry, pose)
        for eye, (own, place) in enumerate(((camera, pose), (geometry.stereo.right, right_pose(geometry, pose)))):
            pixels, which = seen_spots(renderer.mesh, spots, own, place)
            dots[eye] = Dots(pixels, spots.row[which], spots.column[which])
            if eye == 0:
                spot_part = spots.part[which]
    stations = np.linspace(renderer.shape.visible_root_m, renderer.shape.blade.tip_radius_m, 400)
    outline = outlines(renderer.shape, stations)
    leading, trailing = (edges(renderer.shape, outline, camera, pose, side)[0] for side in ("leading", "trailing"))
    frames = [renderer.shape.blade_frame(number) for number in range(len(BLADES))]
    hub = camera.project(pose.from_ned(renderer.shape.hub))[0]
    # A blade's image is a straight line through the hub's: its direction comes from a point close to the hub.
    near = camera.project(pose.from_ned(np.array([frame.to_ned(np.array([5.0, 0.0, 0.0])) for frame in frames])))
    azimuths = np.arctan2(near[:, 1] - hub[1], near[:, 0] - hub[0])
    tip = camera.project(pose.from_ned(renderer.shape.tip_point))[0]
    return TrueView(part, depth, dots[0], dots[1], spot_part, leading, trailing, hub, tip, azimuths)
