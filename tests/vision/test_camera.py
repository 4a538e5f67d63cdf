"""The camera model against OpenCV, and rays and pixels as each other's inverse, for lenses that bend much."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vision.camera import Camera, Lens

STRONG = [
    (-0.1, 0.05, 0.0004, -0.0003),
    (-0.3, 0.1, 0.001, -0.001),
    (-0.45, 0.25, 0.002, 0.001),
    (-0.5, 0.3, 0.01, -0.01),
    (0.3, 0.1, 0.0, 0.0),
]
FISHEYE = [(0.0, 0.0, 0.0, 0.0), (-0.02, 0.01, -0.005, 0.001), (0.05, -0.03, 0.02, -0.004)]


def camera(distortion: tuple[float, float, float, float], focal: float = 2464.0, lens: Lens = "radtan") -> Camera:
    return Camera(2448, 2048, focal, 0.998 * focal, 1230.0, 1015.0, distortion, lens)


def everywhere(step: int = 96) -> np.ndarray:
    """Pixels all over the image, its corners among them."""
    v, u = np.meshgrid(np.r_[0:2047:step, 2047.0], np.r_[0:2447:step, 2447.0])
    return np.column_stack([u.ravel(), v.ravel()])


@pytest.mark.parametrize("distortion", STRONG)
@pytest.mark.parametrize("focal", [2464.0, 1600.0])
def test_pixels_and_rays_are_each_others_inverse_to_the_corners(
    distortion: tuple[float, float, float, float], focal: float
) -> None:
    eye = camera(distortion, focal)
    pixels = everywhere()
    assert np.abs(eye.project(2.5 * eye.rays(pixels)) - pixels).max() < 1e-6


@pytest.mark.parametrize("distortion", STRONG)
def test_points_are_projected_as_opencv_does(distortion: tuple[float, float, float, float]) -> None:
    eye = camera(distortion)
    points = 3.0 * np.column_stack([np.ones(49), *(g.ravel() for g in np.meshgrid(*[np.linspace(-0.45, 0.45, 7)] * 2))])
    theirs, _ = cv2.projectPoints(points[:, [1, 2, 0]], np.zeros(3), np.zeros(3), eye.matrix, np.array(distortion))
    assert np.allclose(eye.project(points), theirs.reshape(-1, 2), atol=1e-9)


@pytest.mark.parametrize("distortion", FISHEYE)
def test_a_fisheye_projects_as_opencvs_and_its_pixels_give_the_rays_back(
    distortion: tuple[float, float, float, float],
) -> None:
    eye = camera(distortion, 1250.0, "equidistant")
    pixels = everywhere()
    rays = eye.rays(pixels)
    assert np.degrees(np.arctan(np.hypot(rays[:, 1], rays[:, 2]).max())) > 68
    theirs, _ = cv2.fisheye.projectPoints(
        rays[None][..., [1, 2, 0]], np.zeros(3), np.zeros(3), eye.matrix, np.array(distortion)
    )
    assert np.allclose(theirs.reshape(-1, 2), pixels, atol=1e-6)
    assert np.allclose(eye.project(rays), pixels, atol=1e-6)


def test_a_fisheye_without_coefficients_bends_and_a_pinhole_does_not() -> None:
    assert camera((0.0,) * 4, lens="equidistant").bends
    assert not camera((0.0,) * 4).bends
    assert not camera(FISHEYE[1], lens="equidistant").pinhole.bends


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(st.floats(-0.6, 0.6), st.floats(-0.3, 0.3), st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)),
    st.floats(0, 2447),
    st.floats(0, 2047),
)
def test_no_pixel_of_any_lens_is_without_a_ray(
    distortion: tuple[float, float, float, float], u: float, v: float
) -> None:
    """A lens as rough as this may fold its image: beyond, no ray is right, but one near the fold is given."""
    rays = camera(distortion, 1400.0).rays(np.array([[u, v]]))
    assert np.isfinite(rays).all()
    assert np.abs(rays).max() < 20
