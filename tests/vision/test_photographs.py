"""Real photographs of a blade with the laser on: no laser-off image, no second eye, no rig."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from vision.observation import BladeObservation
from vision.pipeline import observe_single

FOLDER = Path(__file__).parents[2].parent / "shared" / "data" / "real_frames"
FRAMES = json.loads((FOLDER / "lines.json").read_text())["frames"] if FOLDER.is_dir() else {}
DOTS = {  # counted by eye, those at the border and on the very edges roughly
    "normal_navigation.png": 62,
    "end_detected.png": 24,
    "less_of_blade.png": 82,
    "normal_navigation_horizontal.png": 49,
}

pytestmark = pytest.mark.skipif(not FRAMES, reason=f"the real photographs are not in {FOLDER}")


def observed(name: str) -> tuple[BladeObservation, float]:
    """What was seen, and the factor to pixels of a 612 pixels wide image."""
    image = cv2.imread(str(FOLDER / name))
    assert image is not None
    return observe_single(image), 612 / image.shape[1]


@pytest.mark.parametrize("name", sorted(FRAMES))
def test_what_is_drawn_as_an_edge_is_an_edge(name: str) -> None:
    observation, factor = observed(name)
    drawn = [(np.deg2rad(line["theta_deg"]), line["rho_px"]) for line in FRAMES[name]["edges"]]
    assert observation.edges
    for edge in observation.edges:
        assert any(
            abs(np.rad2deg(np.angle(np.exp(1j * (edge.line.theta - theta))))) < 4
            and abs(edge.line.rho * factor - rho) < 15
            for theta, rho in drawn
        ), (np.rad2deg(edge.line.theta), edge.line.rho * factor)


@pytest.mark.parametrize("name", ["normal_navigation.png", "less_of_blade.png", "normal_navigation_horizontal.png"])
def test_every_drawn_edge_is_found(name: str) -> None:
    observation, _ = observed(name)
    assert len(observation.edges) == len(FRAMES[name]["edges"])


@pytest.mark.parametrize("name", sorted(DOTS))
def test_most_dots_are_found(name: str) -> None:
    observation, _ = observed(name)
    assert observation.dots_left is not None
    assert 0.8 * DOTS[name] <= len(observation.dots_left) <= 1.15 * DOTS[name]


def test_the_tip_is_found_and_no_photograph_without_one_has_one() -> None:
    tips = {name: observed(name)[0].tip is not None for name in FRAMES}
    assert tips == {name: "tip" in FRAMES[name] for name in FRAMES}
