"""Kalibr's camchain YAML, as text, from and to the stereo pair of `vision.camera`.

A camchain holds the left camera as cam0 and the right one as cam1 with T_cn_cnm1, the rigid motion of points from cam0
to cam1. Its axes are OpenCV's (x right, y down, z forward); here they are x forward, y right, z down.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from vision.camera import Camera, Lens, StereoPair

Array = NDArray[np.float64]

FROM_OPENCV = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""(3, 3): a vector in OpenCV's camera axes in this project's camera axes."""
REMEDY = "calibrate with Kalibr's pinhole-radtan or pinhole-equi"


class CamchainError(ValueError):
    """A camchain cannot be used; the message is one line that names the file, the line, the value and what would be
    right."""


def stereo_of_opencv(left: Camera, right: Camera, rotation: Array, translation: Array) -> StereoPair:
    """The pair for rotation (3, 3) and translation (3,) m from left to right in OpenCV's axes, as stereoCalibrate has
    them."""
    turn = FROM_OPENCV
    return StereoPair(left, right, turn @ rotation @ turn.T, turn @ np.asarray(translation, float).reshape(3))


def opencv_motion(stereo: StereoPair) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,) m from left to right in OpenCV's axes."""
    turn = FROM_OPENCV
    return turn.T @ stereo.rotation @ turn, turn.T @ stereo.translation


def parse_camchain(text: str, name: str = "camchain") -> StereoPair:
    """The stereo pair of a camchain's text; `name` is what errors call it.

    Raises:
        CamchainError: with the line at which it goes wrong.
    """
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise CamchainError(f"{name}:{line}: not YAML: {error.problem}") from None
    except (yaml.YAMLError, RecursionError) as error:
        raise CamchainError(f"{name}:1: not YAML: {' '.join(str(error).split())[:120]}") from None
    chain = _Section(root, name, "the file")
    left, right = chain.section("cam0"), chain.section("cam1")
    motion = right.numbers("T_cn_cnm1", (4, 4), "the 4 x 4 matrix that takes points from cam0 to cam1")
    rotation, translation = motion[:3, :3], motion[:3, 3]
    if not np.allclose(motion[3], [0, 0, 0, 1], atol=1e-9):
        raise right.wrong("T_cn_cnm1", "its last row must be 0, 0, 0, 1")
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
        raise right.wrong("T_cn_cnm1", "its upper left 3 x 3 is not a rotation")
    baseline = float(np.linalg.norm(translation))
    if not 0.005 <= baseline <= 5:
        raise right.wrong("T_cn_cnm1", f"the cameras are {baseline:g} m apart; 0.005 to 5 m, in metres, would be right")
    return stereo_of_opencv(_camera(left), _camera(right), _nearest_rotation(rotation), translation)


def format_camchain(stereo: StereoPair) -> str:
    """The camchain's text for a stereo pair."""
    rotation, translation = opencv_motion(stereo)
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = rotation, translation
    lines = []
    for number, camera in enumerate((stereo.left, stereo.right)):
        lines.append(f"cam{number}:")
        if number:
            lines.append("  T_cn_cnm1:")
            lines += [f"  - [{', '.join(_text(value) for value in row)}]" for row in motion]
        lines += [
            f"  cam_overlaps: [{1 - number}]",
            "  camera_model: pinhole",
            f"  distortion_coeffs: [{', '.join(_text(value) for value in camera.distortion)}]",
            f"  distortion_model: {camera.lens}",
            f"  intrinsics: [{', '.join(_text(v) for v in (camera.fx, camera.fy, camera.cx, camera.cy))}]",
            f"  resolution: [{camera.width}, {camera.height}]",
            f"  rostopic: /cam{number}/image_raw",
        ]
    return "\n".join(lines) + "\n"


class _Section:
    """A mapping of the file with the lines of its values."""

    def __init__(self, node: yaml.Node | None, name: str, what: str) -> None:
        self.name, self.what = name, what
        self.line = node.start_mark.line + 1 if node is not None else 1
        if not isinstance(node, yaml.MappingNode):
            raise CamchainError(f"{name}:{self.line}: {what} is not a mapping with cam0 and cam1 and their values")
        self.nodes = {key.value: value for key, value in node.value if isinstance(key, yaml.ScalarNode)}

    def wrong(self, key: str, why: str) -> CamchainError:
        node = self.nodes.get(key)
        line = node.start_mark.line + 1 if node is not None else self.line
        return CamchainError(f"{self.name}:{line}: {key} of {self.what}: {why}")

    def section(self, key: str) -> _Section:
        if key not in self.nodes:
            raise CamchainError(
                f"{self.name}:{self.line}: {key} is missing; a stereo pair has cam0 (left) and cam1 (right)"
            )
        return _Section(self.nodes[key], self.name, key)

    def value(self, key: str, example: str) -> Any:
        if key not in self.nodes:
            raise self.wrong(key, f"missing; {example} is expected")
        try:
            loader = yaml.SafeLoader("")
            return loader.construct_document(self.nodes[key])
        except (yaml.YAMLError, ValueError, RecursionError):
            raise self.wrong(key, f"unreadable; {example} is expected") from None

    def numbers(self, key: str, shape: tuple[int, ...], example: str) -> Array:
        given = self.value(key, example)
        try:
            values = np.array(given, float)
        except (TypeError, ValueError):
            raise self.wrong(key, f"not numbers; {example} is expected") from None
        if values.shape != shape:
            size = " x ".join(str(length) for length in values.shape) or "one value"
            raise self.wrong(key, f"{size} where {example} is expected")
        if not np.isfinite(values).all():
            raise self.wrong(key, "a number in it is not finite")
        return values


def _camera(section: _Section) -> Camera:
    model = section.value("camera_model", "pinhole")
    if model != "pinhole":
        raise section.wrong("camera_model", f"{str(model)[:40]!r} is not known; pinhole is: {REMEDY}")
    lens = section.value("distortion_model", "radtan")
    if lens not in ("radtan", "equidistant", "none"):
        raise section.wrong(
            "distortion_model", f"{str(lens)[:40]!r} is not known; radtan, equidistant and none are: {REMEDY}"
        )
    width, height = section.numbers("resolution", (2,), "[width, height] in pixels")
    if not (16 <= width <= 20000 and 16 <= height <= 20000 and width == int(width) and height == int(height)):
        raise section.wrong("resolution", f"[{width:g}, {height:g}] is no image size")
    fx, fy, cx, cy = section.numbers("intrinsics", (4,), "[fx, fy, cx, cy] in pixels")
    if not (0.1 * width < fx < 100 * width and 0.1 * width < fy < 100 * width):
        raise section.wrong("intrinsics", f"focal lengths {fx:g} and {fy:g} px do not fit a width of {width:g} px")
    if not (0 <= cx <= width and 0 <= cy <= height):
        raise section.wrong("intrinsics", f"the principal point ({cx:g}, {cy:g}) lies outside the image")
    coefficients = np.zeros(4)
    if lens != "none":
        names = "[k1, k2, p1, p2]" if lens == "radtan" else "[k1, k2, k3, k4]"
        coefficients = section.numbers("distortion_coeffs", (4,), names)
    k1, k2, k3, k4 = (float(k) for k in coefficients)
    bending: Lens = "equidistant" if lens == "equidistant" else "radtan"
    return Camera(int(width), int(height), fx, fy, cx, cy, (k1, k2, k3, k4), bending)


def _nearest_rotation(matrix: Array) -> Array:
    """The rotation (3, 3) nearest to a matrix that was rounded when it was written."""
    if np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-12):
        return matrix
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ v, float)


def _text(value: float) -> str:
    """The number as YAML writes it: without its point, 1e-05 would be read as a word."""
    text = repr(float(value))
    return text if "e" not in text or "." in text else text.replace("e", ".0e")
