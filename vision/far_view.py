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
from vision.rotor_fit import Fit, Picture, fit_rotor, plausibility, settled
from vision.rotor_model import HUB, RADIUS, TURN, YAW, surprise
from vision.rotor_search import guesses
from vision.stopwatch import Now, Stopwatch

Array = NDArray[np.float64]

WORKING_PX = 800  # pictures wider than this are halved
MODEL_HUB_PX, MODEL_DIRECTION = 0.6, np.deg2rad(0.25)  # what any model of a blade leaves out, seen from the front
ASIDE_HUB_PX, ASIDE_DIRECTION = 2.0, np.deg2rad(1.0)  # times the sine of the yaw: more of it shows from aside
# Edges that miss the model, or a rotor unlike others, tell that one of the edges is not the blade's: a tower's behind
# it, say. Per px beyond what is usual, and per sigma.
USUAL_MISS_PX, MISS_HUB, MISS_DIRECTION = 0.6, 6.0, np.deg2rad(2.0)
USUAL_SURPRISE, ODD_HUB_PX, ODD_DIRECTION = 3.0, 1.0, np.deg2rad(0.35)
LEAST_SUPPORT = 0.5  # of the better edge of each blade
LEAST_OF_ANY = 0.25  # of any edge long enough to tell
LONG_ENOUGH = 15  # samples of 70
LEAST_SEEN, LEAST_AGREEMENT = 0.85, 0.55  # of all edges, after and before the last fraction of a pixel
MOST_FITS = 4
EQUAL_MERIT = 0.95
MOST_STARTS = 24


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
    settled_on = _settled(picture, guesses(picture.planes, near, within))
    fits = [fit_rotor(picture, parameters) for parameters, _ in settled_on]
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
    model_hub, model_direction = _left_out(best, small)
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
    if camera.bends:
        planes = _straightened(planes, camera)
    blurred = cv2.GaussianBlur(planes, (0, 0), 1.0).reshape(planes.shape)
    return Picture(blurred, camera.pinhole, 0.5 * noise)


def _straightened(planes: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """The picture as a lens without distortion would draw it."""
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.column_stack([np.ones(u.size), (u.ravel() - camera.cx) / camera.fx, (v.ravel() - camera.cy) / camera.fy])
    at = camera.project(rays).astype(np.float32).reshape(*u.shape, 2)
    straight = cv2.remap(planes, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(straight, np.float32).reshape(planes.shape)


def _merit(fit: Fit) -> float:
    """How plausible the fitted rotor is, less what the edges miss it by."""
    return fit.plausibility - 0.1 * min(fit.residual_px, 5.0) if np.isfinite(fit.hub_sigma_px) else 0.0


def _settled(picture: Picture, starts: Array) -> list[tuple[Array, float]]:
    """Where the best of the guesses (k, 12) settle, how plausible they are, the best first."""
    if not len(starts):
        return []
    value = plausibility(picture, starts, samples=12, coarse=True)
    found: list[Array] = []
    for k in np.argsort(-value, kind="stable"):
        if all(_apart(starts[k], other) for other in found):
            found.append(starts[k])
        if len(found) == MOST_STARTS:
            break
    first = sorted((settled(picture, start, rounds=3, tries=200) for start in found), key=lambda pair: -pair[1])
    kept: list[tuple[Array, float]] = []
    for parameters, plausible in first:
        if all(_apart(parameters, other) for other, _ in kept) and plausible > 0.6 * first[0][1]:
            kept.append((parameters, plausible))
    again = [settled(picture, parameters, rounds=5, tries=300, breadth=0.6) for parameters, _ in kept[:MOST_FITS]]
    again.sort(key=lambda pair: -pair[1])
    return [pair for pair in again if pair[1] > 0.7 * again[0][1]]


def _apart(one: Array, other: Array) -> bool:
    """Whether two guesses (12,) lead the search to different places."""
    turn = abs(float(np.angle(np.exp(3j * (one[TURN] - other[TURN]))) / 3))
    size = abs(float(one[RADIUS] - other[RADIUS]))
    return bool(np.linalg.norm(one[HUB] - other[HUB]) > 8 or turn > np.deg2rad(3) or size > 0.3)


def _left_out(fit: Fit, camera: Camera) -> tuple[float, float]:
    """Sigmas, of the hub in px and of directions in rad, of what the model leaves out."""
    aside = float(np.sin(abs(fit.parameters[YAW])))
    missed = max(fit.residual_px - USUAL_MISS_PX, 0.0)
    odd = max(float(np.linalg.norm(surprise(fit.parameters[None], camera))) - USUAL_SURPRISE, 0.0)
    hub = (MODEL_HUB_PX, ASIDE_HUB_PX * aside, MISS_HUB * missed, ODD_HUB_PX * odd)
    turn = (MODEL_DIRECTION, ASIDE_DIRECTION * aside, MISS_DIRECTION * missed, ODD_DIRECTION * odd)
    return float(np.linalg.norm(hub)), float(np.linalg.norm(turn))


def _doubts(fit: Fit, camera: Camera) -> list[str]:
    reasons = []
    best = (fit.support * np.minimum(fit.samples / 12, 1)).max(axis=1)
    if best.min() < LEAST_SUPPORT:
        reasons.append(f"only {int((best >= LEAST_SUPPORT).sum())} of three blades have an edge where it should be")
    if not reasons and fit.support[fit.samples >= LONG_ENOUGH].min(initial=1.0) < LEAST_OF_ANY:
        reasons.append("one edge of a blade is not where it should be")
    seen = float((fit.support * fit.samples).sum() / max(fit.samples.sum(), 1.0))
    if not reasons and (seen < LEAST_SEEN or fit.agreement < LEAST_AGREEMENT):
        reasons.append(f"only {min(seen, fit.agreement):.0%} of the blades' edges are where they should be")
    gaps = np.diff(np.sort(fit.directions), append=np.sort(fit.directions)[0] + 2 * np.pi)
    if np.abs(np.degrees(gaps) - 120).max() > 12:
        reasons.append("the blades are not 120° apart")
    if np.abs(surprise(fit.parameters[None], camera)).max() > 4:
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
