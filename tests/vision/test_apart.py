"""Dots that lie on a blade and on what is behind it: the laser's grid jumps at the blade's edge."""

import cv2
import numpy as np
import pytest

from vision.apart import on_two_surfaces
from vision.lattice import Lattice
from vision.lines import hough_lines, smoothed

SIZE = (400, 420)  # rows, columns
PITCH = 32.0  # px between dots


def seen(jump: tuple[float, float], step: float, bend: float = 0.004) -> bool:
    """A grid of dots over a step of brightness along x = y / 4 + 170, shifted past it; its columns bend."""
    rows, columns = np.indices(SIZE)
    behind = columns > rows / 4 + 170
    image = np.clip(90 + step * behind + np.random.default_rng(2).normal(0, 1.0, SIZE), 0, 255)
    row, column = (part.ravel() for part in np.indices((9, 10)))
    uv = np.column_stack([60 + PITCH * column + bend * (PITCH * row - 130) ** 2, 60 + PITCH * row])
    past = uv[:, 0] > uv[:, 1] / 4 + 170
    uv += np.outer(past, jump) + np.random.default_rng(3).normal(0, 0.3, uv.shape)
    steps = np.array([[PITCH, 0.0], [0.0, PITCH]])
    lattice = Lattice(np.arange(len(uv)), row, column, steps, PITCH)
    tones = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.8), np.uint8)[:, :, None]
    dots = uv - (np.array(SIZE[::-1]) - 1) / 2
    return on_two_surfaces(hough_lines(tones, 1.0, 100), dots, lattice, smoothed(tones), 1.0)


@pytest.mark.parametrize("jump", [(3.0, 0.0), (-2.5, 0.0), (1.5, 1.5), (0.0, -3.0)])
def test_a_grid_that_jumps_at_a_step_lies_on_two_surfaces(jump: tuple[float, float]) -> None:
    assert seen(jump, 60.0)


@pytest.mark.parametrize("bend", [0.0, 0.004, -0.006])
def test_a_grid_that_goes_on_over_paint_or_shade_lies_on_one(bend: float) -> None:
    assert not seen((0.0, 0.0), 60.0, bend)


def test_a_jump_where_nothing_ends_is_not_looked_for() -> None:
    assert not seen((3.0, 0.0), 0.0)
