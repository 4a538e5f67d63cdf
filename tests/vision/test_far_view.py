"""The rotor found in pictures of the simulated world, held against where hub and blades truly are."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from devices.world.settings import Light, WorldSettings
from devices.world.turbine import TurbineShape
from devices.world.view import Renderer, draw
from vision.camera import Camera, RigGeometry, StereoPair
from vision.capture import CameraPose, rotation_of
from vision.far_view import Expected, find_rotor
from vision.rotor_kernels import THICKEST
from vision.rotor_model import CONE, SHAPE, directions, outline, table

CAMERA = Camera(612, 512, 616.0, 616.0, 305.5, 255.5)


def picture(
    azimuth_deg: float,
    *,
    distance: float = 45.0,
    side: float = 0.0,
    camera: Camera = CAMERA,
    background: str = "fields",
    brightness: float = 185.0,
    sun_deg: float = 215.0,
    pitch_deg: float = 2.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An image and the hub (2,) and directions (3,) that geometry says it shows."""
    shape = TurbineShape(north_m=60, east_m=10, heading_deg=8, azimuth_deg=azimuth_deg, pitch_deg=pitch_deg)
    light = Light(background=background, blade_brightness=brightness, sun_azimuth_deg=sun_deg)
    x, y, _ = shape.rotation.T
    place = shape.hub - distance * x + side * y + np.array([0, 0, 1.5])
    sight = shape.hub - place
    pose = CameraPose(place, rotation_of(0.0, 0.02, np.arctan2(sight[1], sight[0]) + 0.04))
    renderer = Renderer(shape, WorldSettings(light=light))
    geometry = RigGeometry(StereoPair(camera, camera, translation=np.array([0.0, -0.2, 0.0])))
    image = draw(renderer, geometry, pose, laser=False).left
    blades = [shape.blade_frame(k).to_ned(np.array([6.0, 0.0, 0.0])) for k in range(3)]
    pixels = camera.project(pose.from_ned(np.array([shape.hub, *blades]))) - camera.centre
    step = pixels[1:] - pixels[0]
    return image, pixels[0], np.sort(np.arctan2(step[:, 1], step[:, 0]) % (2 * np.pi))


VIEWS = {
    "front": {"azimuth_deg": 25.0},
    "blade before the tower": {"azimuth_deg": 60.0, "side": 6.0},
    "blade up, from the left": {"azimuth_deg": 0.0, "side": -12.0},
    "blade along the horizon, from the right": {"azimuth_deg": 90.0, "side": 12.0},
    "near": {"azimuth_deg": 40.0, "distance": 32.0},
    "far, dark, over the sea": {"azimuth_deg": 100.0, "distance": 78.0, "brightness": 90.0, "background": "sea"},
    "feathered, from the front": {"azimuth_deg": 20.0, "pitch_deg": 86.0, "distance": 60.0},
    "half feathered, from aside": {"azimuth_deg": 310.0, "pitch_deg": 50.0, "side": -20.0, "distance": 55.0},
    "very near": {"azimuth_deg": 200.0, "distance": 30.0, "side": 2.0},
    "far aside": {"azimuth_deg": 160.0, "distance": 65.0, "side": 28.0},
    "bright, sun behind the camera": {"azimuth_deg": 75.0, "brightness": 235.0, "sun_deg": 190.0},
}


@pytest.mark.parametrize("view", VIEWS)
def test_hub_and_blades_are_where_they_truly_are(view: str) -> None:
    image, hub, blades = picture(**VIEWS[view])
    found = find_rotor(image, CAMERA)
    assert found.valid, found.reasons
    assert found.hub_sigma_px < 2.5
    assert np.linalg.norm(found.hub - hub) < 3 * found.hub_sigma_px
    off = np.angle(np.exp(1j * (found.directions - blades)))
    assert np.all(np.abs(off) < 3 * found.direction_sigma)
    assert np.all(found.direction_sigma < np.deg2rad(2.0))


def test_grey_and_larger_pictures_show_the_same() -> None:
    large = Camera(1224, 1024, 1232.0, 1232.0, 611.5, 511.5)
    image, hub, _ = picture(20.0, camera=large)
    found = find_rotor(image, large)
    assert found.valid
    assert np.linalg.norm(found.hub - hub) < 3 * found.hub_sigma_px
    grey = find_rotor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), large)
    assert grey.valid
    assert np.linalg.norm(grey.hub - hub) < 3 * grey.hub_sigma_px


def test_a_bent_lens_changes_nothing() -> None:
    bent = replace(CAMERA, distortion=(-0.12, 0.05, 0.0005, -0.0005))
    image, hub, _ = picture(35.0, side=8.0, camera=bent)
    found = find_rotor(image, bent)
    assert found.valid, found.reasons
    assert np.linalg.norm(found.hub - hub) < 3 * found.hub_sigma_px


def test_a_picture_without_a_rotor_is_refused_with_the_reason() -> None:
    image, _, _ = picture(30.0)
    ground = np.ascontiguousarray(image[-200:, :])
    ground = cv2.resize(ground, (612, 512), interpolation=cv2.INTER_LINEAR)
    noise = np.random.default_rng(0).integers(0, 255, (512, 612, 3)).astype(np.uint8)
    for nothing in (ground, noise, np.full((512, 612), 130, np.uint8)):
        found = find_rotor(nothing, CAMERA)
        assert not found.valid
        assert found.reasons and found.hub is None
    assert "612" in find_rotor(image[:, :-2], CAMERA).reasons[0]


def test_two_blades_are_no_rotor() -> None:
    """Three times the same lines, one blade painted over with sky."""
    image, hub, blades = picture(30.0)
    rows, columns = np.mgrid[0:512, 0:612]
    angle = np.arctan2(rows - 255.5 - hub[1], columns - 305.5 - hub[0])
    up = blades[np.argmin(np.sin(blades))]
    gone = np.abs(np.angle(np.exp(1j * (angle - up)))) < np.deg2rad(25)
    image = image.copy()
    image[gone] = image[5, 5]
    assert not find_rotor(image, CAMERA).valid


def test_the_survey_tells_where_to_look() -> None:
    image, hub, _ = picture(110.0)
    found = find_rotor(image, CAMERA, Expected(hub + 15.0, 20.0))
    assert found.valid
    assert np.array_equal(find_rotor(image, CAMERA, Expected(hub + 15.0, 20.0)).hub, found.hub)
    elsewhere = find_rotor(image, CAMERA, Expected(np.array([-250.0, 200.0]), 10.0))
    assert not elsewhere.valid


def test_the_model_draws_the_silhouette_of_solid_blades() -> None:
    """The outline against points all over the skin of three blades, projected by the pinhole alone: the outermost of
    each section to either side of the blade's axis."""
    parameters = np.array([37.0, -24.6, 0.5, 0.2, 0.08, 0.6, np.log(560.0), 0.1, -0.05, 0.2, 0.01, 0.1])
    drawn = outline(parameters[None], 9, CAMERA)[0]
    profile = table(9)
    axes = rotation_of(0.0, -parameters[4], parameters[3])
    hub, radius = np.array([1.0, 37.0 / 616, -24.6 / 616]), 560.0 / 616
    root, widest, tip = SHAPE * np.exp(parameters[[8, 7, 9]])
    ring = np.linspace(0, 2 * np.pi, 2001)
    for b in range(3):
        a = parameters[2] + b * 2 * np.pi / 3
        outward, across = np.array([0.0, np.cos(a), np.sin(a)]), np.array([0.0, -np.sin(a), np.cos(a)])
        back = np.array([1.0, 0.0, 0.0])
        span = np.cos(CONE) * outward - np.sin(CONE) * back
        depth = np.cos(CONE) * back + np.sin(CONE) * outward
        for k, (station, rise, fall, ratio, place, twist) in enumerate(profile):
            chord = root + rise * (widest - root) + fall * (tip - widest)
            thick = chord * (1 + (ratio * np.exp(0.1) - 1) * rise)
            nose = (0.5 - (0.5 - THICKEST) * rise) * chord
            front = (place + 0.01 * rise) * chord
            ahead = np.append(front - nose + nose * np.cos(ring), front - chord)  # the nose, then the trailing edge
            deep = np.append(thick / 2 * np.sin(ring), 0.0)
            turn = 0.6 + twist
            skin = ahead[:, None] * (np.cos(turn) * across - np.sin(turn) * depth)
            skin = skin + deep[:, None] * (np.sin(turn) * across + np.cos(turn) * depth)
            points = hub + radius * (station * span + skin) @ axes.T
            seen = 616 * points[:, 1:] / points[:, :1]
            middle = hub + radius * station * (axes @ span)
            way = np.array([-np.sin(directions(parameters, CAMERA)[b]), np.cos(directions(parameters, CAMERA)[b])])
            off = (seen - 616 * middle[1:] / middle[0]) @ way
            expected = (drawn[b, :, k] - 616 * middle[1:] / middle[0]) @ way
            assert expected[0] == pytest.approx(off.max(), abs=0.25)
            assert expected[1] == pytest.approx(off.min(), abs=0.25)
