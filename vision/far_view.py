"""The rotor from afar: its hub and the directions of its three blades in one picture, or why they cannot be told.

The hub is where the axes of three equal blades meet, not the nose of the spinner that hides it: from aside the nose
stands before another point than the hub's centre.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.camera import Camera
from vision.capture import Image
from vision.observation import FarView
from vision.rotor_fit import Fit, Picture, fit_rotor, settled, start_of
from vision.rotor_model import surprise
from vision.rotor_search import guesses
from vision.stopwatch import Now, Stopwatch

Array = NDArray[np.float64]

WORKING_PX = 800  # pictures wider than this are halved
MODEL_HUB_PX = 1.0  # what equal straight edges leave out: foreshortening, twist, bend
MODEL_DIRECTION = np.deg2rad(0.4)
ASIDE_HUB_PX, ASIDE_DIRECTION = 6.0, np.deg2rad(3.0)  # times the sine of the yaw: twist shows from aside
LEAST_SUPPORT = 0.5  # of the better edge of each blade
LEAST_SEEN, LEAST_AGREEMENT = 0.72, 0.55  # of all edges, after and before the last fraction of a pixel
MOST_FITS = 4
EQUAL_MERIT = 0.95
CLEAR_AGREEMENT = 0.95  # share of the six edges' length at which no wider search is needed


@dataclass(frozen=True)
class Expected:
    """Where the survey expects the hub, in the image frame, px of the full image, and how far off it may be (sigma)."""

    hub: Array
    sigma_px: float


def find_rotor(image: Image, camera: Camera, expected: Expected | None = None, now: Now | None = None) -> FarView:
    """Hub and blades in a picture (h, w, 3) BGR or (h, w) grey taken from 30 to 80 m before the rotor.

    camera: of this picture; with another size the view is refused. Directions and hub are in the image frame as the
    lens draws it, px of the full image. now: the clock that `elapsed_ms` is told by.
    """
    watch = Stopwatch(now)
    if image.shape[:2] != (camera.height, camera.width):
        size = f"{image.shape[1]} x {image.shape[0]}"
        return FarView(False, (f"the picture is {size} px, the camera {camera.width} x {camera.height}",))
    factor = 1
    while camera.width // factor > WORKING_PX:
        factor *= 2
    small = camera.shrunk(factor)
    if factor > 1:
        image = np.asarray(cv2.resize(image, (small.width, small.height), interpolation=cv2.INTER_AREA), np.uint8)
    picture = _picture(image, small)
    near, within = (expected.hub / factor, 4 * expected.sigma_px / factor) if expected is not None else (None, np.inf)
    settled_on = _settled(picture, [start_of(guess) for guess in guesses(picture.planes, near, within)])
    fits = [fit_rotor(picture, *found) for found in settled_on[:MOST_FITS]]
    watch.lap("far_view")
    elapsed = watch.elapsed_ms
    if not fits:
        return FarView(False, ("no three equal blades around a hub",), elapsed_ms=elapsed)
    order = sorted(fits, key=lambda fit: -_merit(fit))
    best = order[0]
    reasons = _doubts(best, small)
    rival = next((fit for fit in order[1:] if _elsewhere(fit, best)), None)
    if rival is not None and _merit(rival) > 0.85 * _merit(best):
        reasons.append("two rotors fit the picture about as well")
    if reasons:
        return FarView(False, tuple(reasons), elapsed_ms=elapsed)
    hub, directions = _as_drawn(best, small)
    # Fits nearly as good that say otherwise show how little the picture tells.
    equals = [fit for fit in order[1:] if _merit(fit) > EQUAL_MERIT * _merit(best) and not _elsewhere(fit, best)]
    hub_off = max((float(np.linalg.norm(fit.parameters[:2] - best.parameters[:2])) for fit in equals), default=0.0)
    turn_off = max((_turned(fit, best) for fit in equals), default=0.0)
    turn = np.argsort(directions)
    aside = float(np.sin(abs(best.parameters[3])))
    model_hub, model_direction = (
        np.hypot(MODEL_HUB_PX, aside * ASIDE_HUB_PX),
        np.hypot(MODEL_DIRECTION, aside * ASIDE_DIRECTION),
    )
    return FarView(
        True,
        (),
        hub * factor,
        float(np.hypot(np.hypot(best.hub_sigma_px, model_hub), hub_off / 2)) * factor,
        directions[turn],
        np.hypot(np.hypot(best.direction_sigma, model_direction), turn_off / 2)[turn],
        elapsed,
    )


def _picture(image: Image, camera: Camera) -> Picture:
    """Grey, and where there is colour how yellow or blue it is: a grey blade before a blue sky may be equally
    bright."""
    if image.ndim == 3:
        colour = image.astype(np.float32)
        grey = colour @ np.array([0.114, 0.587, 0.299], np.float32)
        planes = np.dstack([grey, (colour[..., 2] - colour[..., 0]) * 0.7])
    else:
        planes = image.astype(np.float32)[..., None]
    rough = planes[:, 2:] - 2 * planes[:, 1:-1] + planes[:, :-2]
    noise = max(0.4, 1.4826 * float(np.median(np.abs(rough[::4]))) / np.sqrt(6.0))
    blurred = cv2.GaussianBlur(planes, (0, 0), 1.0).reshape(planes.shape)
    return Picture(blurred, camera, 0.5 * noise)


def _merit(fit: Fit) -> float:
    """Agreement before the last fraction of a pixel, less what the edges then miss the model by."""
    return fit.agreement - 0.15 * fit.residual_px if np.isfinite(fit.hub_sigma_px) else 0.0


def _settled(picture: Picture, starts: list[Array]) -> list[tuple[Array, float]]:
    """Where the guesses settle, with the share of edges that the picture agrees with, the best first."""
    found: list[tuple[Array, float]] = []
    for start in starts:
        found.append(settled(picture, start))
        if found[-1][1] > CLEAR_AGREEMENT:
            # All six edges are there: nothing else in the picture can be as good.
            return [found[-1]]
    # One edge was taken for a line of the background, which a wider search among all six finds out.
    found += [settled(picture, start, rounds=6, tries=500, breadth=1.8) for start in starts[:2]]
    return sorted(found, key=lambda pair: -pair[1])


def _doubts(fit: Fit, camera: Camera) -> list[str]:
    reasons = []
    best = (fit.support * np.minimum(fit.samples / 12, 1)).max(axis=1)
    if best.min() < LEAST_SUPPORT:
        reasons.append(f"only {int((best >= LEAST_SUPPORT).sum())} of three blades have an edge where it should be")
    seen = float((fit.support * fit.samples).sum() / max(fit.samples.sum(), 1.0))
    if not reasons and (seen < LEAST_SEEN or fit.agreement < LEAST_AGREEMENT):
        reasons.append(f"only {min(seen, fit.agreement):.0%} of the blades' edges are where they should be")
    gaps = np.diff(np.sort(fit.directions), append=np.sort(fit.directions)[0] + 2 * np.pi)
    if np.abs(np.degrees(gaps) - 120).max() > 12:
        reasons.append("the blades are not 120° apart")
    if np.abs(surprise(fit.parameters[None])).max() > 4:
        reasons.append("the blades have no blade's proportions")
    if np.any(np.abs(fit.parameters[:2]) > 0.95 * camera.centre):
        reasons.append("the hub lies outside the picture")
    if not (fit.hub_sigma_px < 4 and fit.direction_sigma.max() < np.deg2rad(2)):
        reasons.append("the edges do not determine the hub")
    return reasons


def _elsewhere(one: Fit, other: Fit) -> bool:
    apart = np.linalg.norm(one.parameters[:2] - other.parameters[:2])
    return bool(apart > 25 or _turned(one, other) > np.deg2rad(8))


def _turned(one: Fit, other: Fit) -> float:
    """By how much (rad) two rotors are turned against each other, whichever blades correspond."""
    return abs(float(np.angle(np.exp(3j * (one.directions[0] - other.directions[0]))) / 3))


def _as_drawn(fit: Fit, camera: Camera) -> tuple[Array, Array]:
    """Hub (2,) and directions (3,) in the image frame as the lens draws them."""
    directions, hub = fit.directions, fit.parameters[:2]
    ends = hub + 20 * np.column_stack([np.cos(directions), np.sin(directions)])
    ideal = np.vstack([hub, ends]) + camera.centre
    rays = (ideal - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    drawn = camera.project(np.column_stack([np.ones(4), rays])) - camera.centre
    step = drawn[1:] - drawn[0]
    return drawn[0], np.arctan2(step[:, 1], step[:, 0]) % (2 * np.pi)
