"""Real photographs of a blade with the laser on: no laser-off image, no second eye, no rig."""

import json
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.vision.counted_dots import COUNTED
from vision.capture import Image
from vision.observation import BladeObservation
from vision.pipeline import observe_single

FOLDER = Path(__file__).parents[2].parent / "shared" / "data" / "real_frames"
FRAMES = json.loads((FOLDER / "lines.json").read_text())["frames"] if FOLDER.is_dir() else {}
SAME_DOT_PX = 4.0  # a dot is a streak of up to 14 px here

pytestmark = pytest.mark.skipif(not FRAMES, reason=f"the real photographs are not in {FOLDER}")


@cache
def photograph(name: str) -> Image:
    image = cv2.imread(str(FOLDER / name), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return np.asarray(image, np.uint8)


@cache
def observed(name: str) -> BladeObservation:
    return observe_single(photograph(name))


def off(theta: float, rho: float, line: dict[str, float]) -> tuple[float, float]:
    """By how many degrees, and how many pixels of a 612 pixels wide image, a line differs from a drawn one."""
    turned = abs(np.rad2deg(np.angle(np.exp(1j * (theta - np.deg2rad(line["theta_deg"]))))))
    return float(turned), abs(rho - line["rho_px"])


@pytest.mark.parametrize("name", sorted(FRAMES))
def test_the_edges_are_those_that_were_drawn(name: str) -> None:
    seen, drawn = observed(name), FRAMES[name]["edges"]
    factor = 612 / photograph(name).shape[1]
    assert seen.valid and len(seen.edges) == len(drawn)
    for line in drawn:
        errors = [off(edge.line.theta, edge.line.rho * factor, line) for edge in seen.edges]
        assert any(turned < 4 and shift < 15 for turned, shift in errors), (line, errors)


@pytest.mark.parametrize("name", sorted(FRAMES))
def test_the_tip_is_where_it_was_drawn_and_nowhere_else(name: str) -> None:
    seen, drawn = observed(name), FRAMES[name].get("tip")
    if drawn is None:
        assert seen.tip is None
        return
    assert seen.tip is not None
    turned, shift = off(seen.tip.line.theta, seen.tip.line.rho * 612 / photograph(name).shape[1], drawn)
    assert turned < 4 and shift < 15


@pytest.mark.parametrize("name", sorted(COUNTED))
def test_the_dots_are_those_that_a_person_counts(name: str) -> None:
    counted, doubtful = (np.array(points, float).reshape(-1, 2) for points in COUNTED[name])
    seen = observed(name).dots_left
    assert seen is not None
    apart = np.hypot(*(seen.uv[:, None] - counted[None]).transpose(2, 0, 1))
    near = apart.min(axis=1) < SAME_DOT_PX
    assert len(set(apart.argmin(axis=1)[near].tolist())) >= 0.95 * len(counted)
    if len(doubtful):
        near |= np.hypot(*(seen.uv[:, None] - doubtful[None]).transpose(2, 0, 1)).min(axis=1) < 1.5 * SAME_DOT_PX
    assert (~near).sum() <= 0.02 * len(seen)


@pytest.mark.parametrize("name", sorted(COUNTED))
def test_rows_run_down_and_columns_to_the_right(name: str) -> None:
    dots = observed(name).dots_left
    assert dots is not None
    at = {(int(r), int(c)): uv for r, c, uv in zip(dots.row, dots.column, dots.uv, strict=True)}
    assert len(at) == len(dots) and min(dots.row) == min(dots.column) == 0
    for (r, c), here in at.items():
        if (r, c + 1) in at:
            assert at[r, c + 1][0] - here[0] > 12 and abs(at[r, c + 1][1] - here[1]) < 14
        if (r + 1, c) in at:
            assert at[r + 1, c][1] - here[1] > 12 and abs(at[r + 1, c][0] - here[0]) < 14


def turned_quarter(image: Image) -> tuple[Image, np.ndarray, np.ndarray]:
    height = image.shape[0]
    return np.rot90(image, -1).copy(), np.array([[0.0, -1.0], [1.0, 0.0]]), np.array([height - 1.0, 0.0])


def mirrored(image: Image) -> tuple[Image, np.ndarray, np.ndarray]:
    return image[:, ::-1].copy(), np.diag([-1.0, 1.0]), np.array([image.shape[1] - 1.0, 0.0])


def enlarged(image: Image) -> tuple[Image, np.ndarray, np.ndarray]:
    scale = 1.7
    large = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    return large, np.diag([scale, scale]), np.full(2, 0.5 * scale - 0.5)


def darker(image: Image) -> tuple[Image, np.ndarray, np.ndarray]:
    return np.asarray(255 * (image / 255.0) ** 1.15 * 0.75, np.uint8), np.eye(2), np.zeros(2)


def noisier(image: Image) -> tuple[Image, np.ndarray, np.ndarray]:
    noise = np.random.default_rng(1).normal(0, 2.0, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8), np.eye(2), np.zeros(2)


def compressed(image: Image) -> tuple[Image, np.ndarray, np.ndarray]:
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 60])[1]
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), np.uint8), np.eye(2), np.zeros(2)


def as_large_as_the_camera_takes_it(image: Image) -> tuple[Image, np.ndarray, np.ndarray]:
    scale = 2448 / image.shape[1]
    large = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    return np.dstack([large] * 3), np.diag([scale, scale]), np.full(2, 0.5 * scale - 0.5)


@pytest.mark.parametrize(
    "changed", [turned_quarter, mirrored, enlarged, darker, noisier, compressed, as_large_as_the_camera_takes_it]
)
@pytest.mark.parametrize("name", ["end_detected.png", "normal_navigation_horizontal.png"])
def test_a_changed_photograph_shows_the_same_changed(name: str, changed) -> None:  # type: ignore[no-untyped-def]
    before = observed(name)
    image, turn, shift = changed(photograph(name))
    after = observe_single(image)
    assert before.dots_left is not None and after.dots_left is not None
    expected = before.dots_left.uv @ turn.T + shift
    scale = float(np.sqrt(abs(np.linalg.det(turn))))
    apart = np.hypot(*(after.dots_left.uv[:, None] - expected[None]).transpose(2, 0, 1))
    assert (apart.min(axis=0) < 2.5 * scale).mean() > 0.9
    assert (apart.min(axis=1) < 2.5 * scale).mean() > 0.95
    assert len(after.edges) == len(before.edges)
    for edge in before.edges:
        outward = turn @ edge.outward / scale
        offset = scale * edge.line.rho * np.sign(np.cos(edge.line.theta - np.arctan2(edge.outward[1], edge.outward[0])))
        twin = max(after.edges, key=lambda one: float(one.outward @ outward))
        assert np.rad2deg(np.arccos(min(float(twin.outward @ outward), 1.0))) < 2.5
        sign = np.sign(np.cos(twin.line.theta - np.arctan2(twin.outward[1], twin.outward[0])))
        assert abs(twin.line.rho * sign - offset) < 4 * scale
    assert (after.tip is None) == (before.tip is None)


@pytest.mark.parametrize("degrees", [0.0, 17.0, -28.0, 45.0])
def test_a_photograph_turned_by_any_angle_shows_the_same_edges(degrees: float) -> None:
    name = "normal_navigation_horizontal.png"
    image = photograph(name)
    height, width = image.shape
    centre = (np.array([width, height]) - 1) / 2
    matrix = cv2.getRotationMatrix2D(tuple(centre), -degrees, 1.0)  # clockwise, as theta is
    turned = cv2.warpAffine(image, matrix, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT_101)
    # Where nothing was photographed the border is mirrored; the edges beside the dots are all there.
    seen = observe_single(np.asarray(turned, np.uint8))
    assert seen.valid
    for edge in seen.edges:
        errors = [
            off(edge.line.theta - np.deg2rad(degrees), edge.line.rho * 612 / width, line)
            for line in FRAMES[name]["edges"]
        ]
        assert any(turn < 4 and shift < 15 for turn, shift in errors), errors


@pytest.mark.parametrize("degrees", [39.4, 46.6, 133.0, 222.9, 327.0])
def test_no_edge_of_a_rounded_tip_that_the_frame_cuts_anyhow_is_wrong_without_a_word(degrees: float) -> None:
    name = "end_detected.png"
    image = photograph(name)
    height, width = image.shape
    a = np.deg2rad(degrees)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    side = int(min(width, height) / (abs(np.cos(a)) + abs(np.sin(a))))  # the largest square that lies in it
    shift = np.full(2, (side - 1) / 2) - turn @ np.array([(width - 1) / 2, (height - 1) / 2])
    turned = cv2.warpAffine(image, np.column_stack([turn, shift]), (side, side), flags=cv2.INTER_CUBIC)
    seen = observe_single(np.asarray(turned, np.uint8))
    assert seen.valid == bool(seen.edges) and seen.valid != bool(seen.reasons)
    for edge in seen.edges:
        errors = [off(edge.line.theta - a, edge.line.rho * 612 / width, line) for line in FRAMES[name]["edges"]]
        assert any(angle < 7 and apart < 18 for angle, apart in errors), errors


@pytest.mark.parametrize("channel", [1, 2], ids=["green", "red"])
def test_a_coloured_laser_on_grey_is_seen_as_well(channel: int) -> None:
    name = "normal_navigation.png"
    image = photograph(name)
    plain = cv2.morphologyEx(image, cv2.MORPH_OPEN, np.ones((9, 9), np.uint8))
    coloured = np.dstack([plain] * 3)
    coloured[:, :, channel] = image
    counted = np.array(COUNTED[name][0], float)
    seen = observe_single(coloured).dots_left
    assert seen is not None
    apart = np.hypot(*(seen.uv[:, None] - counted[None]).transpose(2, 0, 1))
    assert (apart.min(axis=0) < SAME_DOT_PX).mean() >= 0.95


@pytest.mark.parametrize("deep", [np.uint16(257), np.uint16(16)], ids=["16 bits", "12 of 16 bits"])
def test_more_bits_a_channel_change_nothing(deep: np.uint16) -> None:
    image = photograph("end_detected.png")
    dots = [observe_single(one).dots_left for one in (image, np.dstack([image] * 4), image * deep)]
    for one in dots[1:]:
        assert dots[0] is not None and one is not None
        assert len(one) == len(dots[0]) and np.abs(one.uv - dots[0].uv).max() < 0.5


def refused_images() -> dict[str, Image]:
    noise = np.random.default_rng(3)
    return {
        "wall": np.full((211, 252), 90, np.uint8),
        "black": np.zeros((64, 64, 3), np.uint8),
        "white": np.full((1200, 40), 255, np.uint8),
        "noise": noise.integers(0, 256, (512, 612, 3)).astype(np.uint8),
        "one row": noise.integers(0, 256, (1, 612)).astype(np.uint8),
        "10 x 10": noise.integers(0, 256, (10, 10)).astype(np.uint8),
        "nothing": np.zeros((0, 0), np.uint8),
        "slope": np.tile(np.arange(612) // 3, (512, 1)).astype(np.uint8),
    }


@pytest.mark.parametrize("what", refused_images())
def test_what_holds_no_dots_is_refused_in_words(what: str) -> None:
    seen = observe_single(refused_images()[what])
    assert not seen.valid and seen.edges == () and seen.tip is None
    assert len(seen.reasons) == 1 and "in a grid" in seen.reasons[0]
