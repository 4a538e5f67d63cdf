"""The outline of a blade that stands out from all that is around it, and what of it is edge and what end."""

import cv2
import numpy as np
import pytest

from vision.capture import Image
from vision.outline import shape_of
from vision.silhouette import Silhouette, silhouette_of

SIZE = (300, 360)  # rows, columns
WIDE = 120.0  # px, of the blade
CORNER = np.array([60.0, 45.0])  # px, of its rounded corner, across and along


def drawn(angle_deg: float, ends: bool, background: int = 150, tone: int = 25) -> tuple[Image, np.ndarray, np.ndarray]:
    """A dark blade on a chequered wall, its dots (n, 2) px, and its direction (2,) to its end, if it ends: cut off
    square, one corner rounded."""
    t = np.deg2rad(np.linspace(0, 90, 30))
    rounded = np.column_stack([WIDE / 2 - CORNER[0] * (1 - np.cos(t)), 40 - CORNER[1] * (1 - np.sin(t))])
    far = 500.0 if not ends else 40.0
    outline = np.vstack([[[-WIDE / 2, -500], [WIDE / 2, -500]], rounded if ends else [[WIDE / 2, far]]])
    outline = np.vstack([outline, [[-WIDE / 2, far]]])
    a = np.deg2rad(angle_deg)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    middle = (np.array(SIZE[::-1]) - 1) / 2
    rows, columns = np.indices(SIZE)
    wall = background + 40 * ((rows // 25 + columns // 31) % 2)
    blade = np.zeros(SIZE, np.uint8)
    cv2.fillPoly(blade, [np.rint((outline @ turn.T + middle) * 16).astype(np.int32)], 255, cv2.LINE_AA, 4)
    share = cv2.GaussianBlur(blade, (0, 0), 0.8) / 255.0
    image = wall * (1 - share) + tone * share + np.random.default_rng(1).normal(0, 1.0, SIZE)
    grid = np.stack(np.meshgrid([-45.0, -15.0, 15.0, 45.0], [-85.0, -55.0, -25.0, 0.0]), axis=-1).reshape(-1, 2)
    return np.clip(image, 0, 255).astype(np.uint8)[:, :, None], grid @ turn.T + middle, turn[:, 1]


def seen(angle_deg: float, ends: bool, **light: int) -> tuple[Silhouette, np.ndarray]:
    image, dots, toward = drawn(angle_deg, ends, **light)
    found = silhouette_of(image, dots, 1.0)
    assert found is not None
    return found, toward


@pytest.mark.parametrize("angle_deg", range(0, 360, 40))
def test_edges_of_a_blade_with_a_rounded_end_are_its_straight_stretches_at_any_angle(angle_deg: float) -> None:
    silhouette, toward = seen(angle_deg, True)
    shape = shape_of(silhouette)
    assert shape is not None and len(shape.edges) == 2 and shape.end is not None
    across = np.array([-toward[1], toward[0]])
    middle = (np.array(SIZE[::-1]) - 1) / 2
    for edge in shape.edges:
        assert np.rad2deg(np.arccos(min(abs(float(edge.outward @ across)), 1.0))) < 2.0
        assert abs(abs(float((edge.middle - middle) @ across)) - WIDE / 2) < 2.0
    assert shape.end.toward @ toward > np.cos(np.deg2rad(3.0))
    assert abs(float((shape.end.point - middle) @ toward) - 40.0) < 3.0


@pytest.mark.parametrize("angle_deg", range(0, 180, 25))
def test_a_blade_that_goes_on_has_no_end(angle_deg: float) -> None:
    shape = shape_of(seen(angle_deg, False)[0])
    assert shape is not None and len(shape.edges) == 2 and shape.end is None


def test_a_bright_blade_before_a_dark_wall_is_outlined_as_well() -> None:
    shape = shape_of(seen(35.0, True, background=40, tone=190)[0])
    assert shape is not None and len(shape.edges) == 2 and shape.end is not None


def test_a_corner_alone_does_not_tell_edge_from_end() -> None:
    image, dots, _ = drawn(0.0, True)
    corner, kept = image[60:, :230], dots - [0, 60]
    silhouette = silhouette_of(corner, kept[(kept[:, 0] < 226) & (kept[:, 1] > 3)], 1.0)
    assert silhouette is not None
    cut = silhouette.within(np.array([-1.0, 0.0]), 0.0)  # what is to the left is out of view
    assert shape_of(Silhouette(cut.mask[:, 115:], tuple(c[c[:, 0] > 119] for c in cut.chains), cut.slope)) is None


def test_a_blade_as_bright_as_its_surroundings_has_no_outline() -> None:
    image, dots, _ = drawn(20.0, True, background=20, tone=40)
    assert silhouette_of(np.asarray(cv2.GaussianBlur(image, (0, 0), 9), np.uint8)[:, :, None], dots, 1.0) is None


def test_what_lies_past_a_known_edge_is_left_out() -> None:
    silhouette, toward = seen(0.0, False)
    across = np.array([-toward[1], toward[0]])
    cut = silhouette.within(across, 20.0)
    assert 0.6 < cut.mask.sum() / silhouette.mask.sum() < 0.72
    assert all(((chain - (np.array(SIZE[::-1]) - 1) / 2) @ across < 27).all() for chain in cut.chains)
