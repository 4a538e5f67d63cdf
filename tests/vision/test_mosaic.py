"""Raw mosaics of colour cameras, observed without demosaicing."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from devices.scenes import draw_scene, random_settings
from vision.camera import Bayer
from vision.mosaic import demosaiced
from vision.pipeline import Eye
from vision.reduction import reduce_image

PATTERNS: tuple[Bayer, ...] = ("rggb", "grbg", "gbrg", "bggr")


def mosaic(image: NDArray[np.uint8], bayer: Bayer) -> NDArray[np.uint8]:
    """What a camera with this pattern delivers of a BGR image."""
    raw = np.empty(image.shape[:2], np.uint8)
    for k, colour in enumerate(bayer):
        raw[k // 2 :: 2, k % 2 :: 2] = image[k // 2 :: 2, k % 2 :: 2, "bgr".index(colour)]
    return raw


@pytest.mark.parametrize("bayer", PATTERNS)
@pytest.mark.parametrize("factor", [1, 2, 4, 8])
def test_each_colour_of_a_mosaic_is_averaged_into_its_own_channel(bayer: Bayer, factor: int) -> None:
    image = np.empty((32, 48, 3), np.uint8)
    image[:, :24], image[:, 24:] = (10, 90, 200), (240, 30, 60)
    reduced = reduce_image(mosaic(image, bayer), factor, bayer)
    assert reduced.shape == (32 // factor, 48 // factor, 3)
    middle = reduced.shape[1] // 2
    assert (reduced[:, : middle - 1] == (10, 90, 200)).all() and (reduced[:, middle + 1 :] == (240, 30, 60)).all()


@pytest.mark.parametrize("bayer", PATTERNS)
def test_green_of_a_reduced_mosaic_lies_where_it_does_in_the_reduced_colour_image(bayer: Bayer) -> None:
    coarse = np.random.default_rng(3).integers(40, 215, (12, 12, 3), np.uint8)
    smooth = np.asarray(cv2.resize(coarse, (256, 256), interpolation=cv2.INTER_CUBIC), np.uint8)
    raw, colour = reduce_image(mosaic(smooth, bayer), 4, bayer), reduce_image(smooth, 4)
    away, _ = cv2.phaseCorrelate(raw[..., 1].astype(np.float64), colour[..., 1].astype(np.float64))
    assert np.hypot(*away) < 0.01
    assert np.abs(demosaiced(mosaic(smooth, bayer), bayer).astype(int) - smooth).mean() < 2


def test_an_image_without_a_pattern_stays_grey() -> None:
    assert reduce_image(np.zeros((64, 64), np.uint8), 4).shape == (16, 16)


@pytest.mark.parametrize("bayer", ["rggb", "gbrg"])
def test_the_eye_sees_as_well_in_mosaics_as_in_colour(bayer: Bayer) -> None:
    scene = draw_scene(random_settings(9001, colour=True, scale=4, distance_m=3.0, brightness=140.0))
    names = ("left", "right", "left_laser", "right_laser")
    raw = replace(scene.frames, **{name: mosaic(getattr(scene.frames, name), bayer) for name in names})
    seen = Eye(replace(scene.geometry, bayer=bayer)).observe(raw)
    assert seen.valid and seen.dots_left is not None
    assert seen.distance_m == pytest.approx(scene.truth.distance_m, rel=0.003)
    true = scene.truth.dots("left").uv
    away = np.hypot(*(true[:, None] - seen.dots_left.uv[None]).transpose(2, 0, 1)).min(axis=1)
    assert np.mean(away < 1.0) > 0.97 and np.sqrt(np.mean(away[away < 2] ** 2)) < 0.4
