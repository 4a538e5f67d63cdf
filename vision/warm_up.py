"""Lets an eye look at a drawn blade before anything flies, so that its inner loops are compiled by then."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera, RigGeometry
from vision.capture import Image, StereoFrames
from vision.far_view import find_rotor
from vision.grid import expected_points
from vision.mosaic import RED_AT
from vision.observation import BladeObservation
from vision.pipeline import Eye

Array = NDArray[Any]  # of floats

DISTANCE_M = 3.0
HALF_WIDTH = 0.55  # of the reach of the laser's grid to each side: where the blade's edges are
BLADE, BACKGROUND, DOT = 170.0, 90.0, 70.0  # grey levels, and what a dot adds to green
FAR_WIDTH = 300  # px, of the picture of a rotor
DOT_PX = 1.6  # standard deviation of a dot at working size


def warm_up(eye: Eye) -> BladeObservation:
    """What the eye says of the specimen, after a look at a rotor from afar; takes seconds when inner loops are not
    compiled yet, and compiled ones are kept on disk."""
    small = eye.geometry.stereo.left.shrunk(max(1, eye.geometry.stereo.left.width // FAR_WIDTH))
    find_rotor(rotor(small), small)
    return eye.observe(specimen(eye.geometry, eye.factor))


def rotor(camera: Camera) -> Image:
    """Picture (h, w) of a tower with three blades, flat and square before the camera."""
    image = np.full((camera.height, camera.width), BACKGROUND, np.uint8)
    hub, radius = (np.array(image.shape[::-1]) - 1) / 2, 0.4 * camera.height
    outlines = [np.array([[-0.03, 0.0], [0.03, 0.0], [0.04, 2.0], [-0.04, 2.0]])]
    for turn in np.deg2rad([40.0, 160.0, 280.0]):
        along, across = np.array([np.sin(turn), -np.cos(turn)]), np.array([np.cos(turn), np.sin(turn)])
        outlines.append(np.array([across * 0.05, along * 0.25 + across * 0.06, along, -across * 0.05]))
    for outline in outlines:
        cv2.fillPoly(image, [np.rint(hub + radius * outline).astype(np.int32)], BLADE)
    return image


def specimen(geometry: RigGeometry, factor: int = 1) -> StereoFrames:
    """Four images (h, w, 3), or (h, w) raw mosaics where the rig delivers those, of an upright blade that ends in view,
    square before the left camera, as the rig's cameras would see it; drawn at 1 / factor of their size."""
    stereo, laser = geometry.stereo.shrunk(factor), geometry.laser
    dots = np.empty((0, 3))
    middle, reach = np.zeros(2), np.full(2, 0.25 * DISTANCE_M)
    if laser is not None:
        dots = expected_points(laser, DISTANCE_M, np.zeros(2))
        dots = dots[np.isfinite(dots[:, 0])]
        middle, reach = np.median(dots[:, 1:], axis=0), np.ptp(dots[:, 1:], axis=0) / 2
    tip = middle[1] - HALF_WIDTH * reach[1]

    def on_blade(points: Array) -> NDArray[np.bool_]:
        inside = np.abs(points[:, 1] - middle[0]) < HALF_WIDTH * reach[0]
        return np.asarray(inside & (points[:, 2] > tip), np.bool_)

    dots = dots[on_blade(dots)]
    images: list[Image] = []
    for camera, full, rotation, translation in (
        (stereo.left, geometry.stereo.left, np.eye(3), np.zeros(3)),
        (stereo.right, geometry.stereo.right, stereo.rotation, stereo.translation),
    ):
        v, u = np.mgrid[: camera.height, : camera.width]
        rays = camera.rays(np.column_stack([u.ravel(), v.ravel()])) @ rotation
        lens = -translation @ rotation
        points = lens + rays * ((DISTANCE_M - lens[0]) / rays[:, :1])
        plain = np.where(on_blade(points), BLADE, BACKGROUND).reshape(camera.height, camera.width)
        lit = plain + DOT * _spots(camera, dots @ rotation.T + translation)
        images += [_taken(plain, plain, factor, full, geometry), _taken(plain, lit, factor, full, geometry)]
    return StereoFrames(0.0, images[0], images[2], images[1], images[3])


def _spots(camera: Camera, dots: Array) -> Array:
    """Gaussian spots (h, w), of height one, where a camera sees dots (n, 3)."""
    uv = camera.project(dots)
    uv = uv[np.isfinite(uv[:, 0])]
    across, down = (
        np.exp(-0.5 * ((np.arange(size) - uv[:, axis, None]) / DOT_PX) ** 2)
        for axis, size in enumerate((camera.width, camera.height))
    )
    light: Array = down.T @ across
    return light


def _taken(grey: Array, green: Array, factor: int, camera: Camera, geometry: RigGeometry) -> Image:
    """An image as the rig's camera delivers it, each pixel repeated, the last ones to the border."""
    image = np.stack([grey, green, grey], axis=2).clip(0, 255).astype(np.uint8)
    image = image.repeat(factor, axis=0).repeat(factor, axis=1)
    missing = ((0, camera.height - image.shape[0]), (0, camera.width - image.shape[1]), (0, 0))
    image = np.ascontiguousarray(np.pad(image, missing, mode="edge"))
    if geometry.bayer is None:
        return image
    row, column = RED_AT[geometry.bayer]
    raw = image[..., 0].copy()
    for v, u in ((row, 1 - column), (1 - row, column)):
        raw[v::2, u::2] = image[v::2, u::2, 1]
    return raw
