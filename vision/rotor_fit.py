"""Fits the rotor model to the edges in a picture: first to the picture as a whole, then to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from vision.camera import Camera
from vision.rotor_kernels import agreements
from vision.rotor_model import CHORD, CONE, HUB, RADIUS, SHAPE, SIZE, directions, lens, outline, surprise, table

Array = NDArray[np.float64]

SAMPLES = 70  # along each edge
REACHES = (5.0, 3.0)  # px across the expected edge in which it is looked for, round by round
EDGE_PX = 1.0  # sigma of one edge point: what straight edges leave out, more than what the picture does
NEIGHBOURS = 6.0  # points that err together
AGREES_PX = 2.5
COARSE_PX = 2.0
SURPRISE = 0.006  # of agreement that one sigma squared of surprise is worth
SCALE = np.array([1.0, 1.0, 0.01, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.02, 0.1])
SPREAD = np.array([6.0, 6.0, 0.03, 0.15, 0.06, 0.2, 0.2, 0.10, 0.08, 0.2, 0.02, 0.08])  # of the search around a guess


@dataclass(frozen=True)
class Picture:
    """Channels (h, w, c) as float32, slightly blurred, as a camera without distortion sees them; `noise` in grey levels
    of any channel."""

    planes: NDArray[np.float32]
    camera: Camera
    noise: float

    @cached_property
    def gradient(self) -> NDArray[np.float32]:
        """(h, w, 2): the derivatives (right, down) of the channel that changes most, grey levels a pixel."""
        return _gradient(self.planes)

    @cached_property
    def coarse(self) -> NDArray[np.float32]:
        """The same of the picture blurred, in which an edge is felt from further away."""
        return _gradient(cv2.GaussianBlur(self.planes, (0, 0), COARSE_PX).reshape(self.planes.shape))

    def at(self, points: Array) -> Array:
        """Values (n, m, c) at points (n, m, 2) of the undistorted image frame."""
        pixels = (points + (np.array(self.planes.shape[1::-1]) - 1) / 2).astype(np.float32)
        u, v = np.ascontiguousarray(pixels[..., 0]), np.ascontiguousarray(pixels[..., 1])
        values = cv2.remap(self.planes, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(values, float).reshape(*points.shape[:-1], -1)


def _gradient(planes: NDArray[np.float32]) -> NDArray[np.float32]:
    both = [cv2.Sobel(planes, cv2.CV_32F, *order, scale=0.125).reshape(planes.shape) for order in ((1, 0), (0, 1))]
    strongest = np.argmax(np.abs(both[0]) + np.abs(both[1]), axis=2)[..., None]
    return np.ascontiguousarray(np.concatenate([np.take_along_axis(g, strongest, 2) for g in both], axis=2))


@dataclass(frozen=True)
class Fit:
    """The fitted rotor. parameters (12,): of `vision.rotor_model`. directions (3,) of the blades in the undistorted
    image.

    support (3, 2): for each blade, leading and trailing, the share of samples (3, 2) inside the picture that lie on the
    fitted edge. agreement: share of the edges' whole length on which the picture changes across them; plausibility: as
    the function says.
    """

    parameters: Array
    hub_sigma_px: float
    directions: Array
    direction_sigma: Array
    support: Array
    samples: Array
    residual_px: float
    agreement: float
    plausibility: float


def fit_rotor(picture: Picture, parameters: Array) -> Fit:
    """Settled parameters (12,) moved to where the edges really are, with their support."""
    agreed = float(agreement(picture, parameters[None])[0, 0])
    edges = edge_points(picture, parameters, REACHES[0])
    jacobian = np.zeros((0, len(SCALE)))
    for reach in REACHES:
        edges = edge_points(picture, parameters, reach)
        if edges.real.sum() < 30:
            break
        arguments = (edges.only(edges.real), picture.camera)
        solution = least_squares(
            _residuals, parameters, args=arguments, x_scale=SCALE, loss="soft_l1", f_scale=1.5, max_nfev=8, xtol=1e-5
        )
        parameters, jacobian = solution.x, np.asarray(solution.jac, float)
    residual = EDGE_PX * _residuals(parameters, edges, picture.camera)[: len(edges.real)]
    agrees = edges.real & (np.abs(residual) < AGREES_PX)
    support, samples = np.zeros((3, 2)), np.zeros((3, 2))
    for b in range(3):
        for s in range(2):
            here = (edges.blade == b) & (edges.side == s)
            samples[b, s] = here.sum()
            support[b, s] = agrees[here].mean() if here.any() else 0.0
    rms = float(np.sqrt(np.mean(residual[agrees] ** 2))) if agrees.any() else np.inf
    covariance = np.full((SIZE, SIZE), np.inf)
    if agrees.sum() > 30:
        covariance = np.linalg.pinv(jacobian.T @ jacobian) * max(rms / EDGE_PX, 0.7) ** 2 * NEIGHBOURS
    here = directions(parameters, picture.camera)
    return Fit(
        parameters,
        float(np.sqrt((covariance[0, 0] + covariance[1, 1]) / 2)),
        here,
        _direction_sigma(parameters, covariance, picture.camera),
        support,
        samples,
        rms,
        agreed,
        float(plausibility(picture, parameters[None])[0]),
    )


def _direction_sigma(parameters: Array, covariance: Array, camera: Camera) -> Array:
    """Sigmas (3,) of the directions: turn, yaw and tilt of the rotor all turn the blades in the picture."""
    if not np.isfinite(covariance).all():
        return np.full(3, np.inf)
    steps = np.diag(SCALE * 1e-3)
    turned = [directions(parameters + step, camera) - directions(parameters - step, camera) for step in steps]
    by = np.angle(np.exp(1j * np.array(turned))).T / (2e-3 * SCALE)
    result: Array = np.sqrt(np.diag(by @ covariance @ by.T))
    return result


def settled(picture: Picture, start: Array, rounds: int, tries: int, breadth: float = 1.0) -> tuple[Array, float]:
    """The parameters (12,) near `start` that are most plausible in the picture, and how plausible they are.

    A cross-entropy search: any line of the background may be stronger than one edge of one blade, but nothing else
    agrees with all six at once. breadth: of the search, 1 for a good guess. The same picture gives the same answer.
    """
    rng = np.random.default_rng(0)
    mean = start.copy()
    spread = breadth * SPREAD
    spread[HUB] += breadth * 0.1 * SHAPE[1] * np.exp(start[RADIUS] + start[CHORD])
    best, best_value = start, -np.inf
    for _ in range(rounds):
        drawn = mean + spread * rng.standard_normal((tries, SIZE))
        drawn[0] = best
        value = plausibility(picture, drawn)
        order = np.argsort(-value, kind="stable")[: max(tries // 10, 12)]
        if value[order[0]] > best_value:
            best, best_value = drawn[order[0]], float(value[order[0]])
        mean, spread = drawn[order].mean(axis=0), 1.1 * drawn[order].std(axis=0) + 1e-6
    return best, best_value


def plausibility(picture: Picture, parameters: Array, samples: int = 30, coarse: bool = False) -> Array:
    """(k,): how much of the picture rotors (k, 12) explain, in image diagonals, less what is surprising about them."""
    explained = agreement(picture, parameters, samples, coarse)[:, 1]
    diagonal = float(np.hypot(*picture.planes.shape[:2]))
    result: Array = explained / (2 * diagonal) - SURPRISE * (surprise(parameters, picture.camera) ** 2).sum(axis=1)
    return result


def agreement(picture: Picture, parameters: Array, samples: int = 30, coarse: bool = False) -> Array:
    """(k, 2): share of the six edges' length, 0 to 1, on which the picture changes across them, for parameters
    (k, 12), and by how many px it does so beyond chance."""
    gradient, step = (picture.coarse, 2 * picture.noise + 0.5) if coarse else (picture.gradient, 4 * picture.noise + 1)
    result: Array = agreements(
        np.ascontiguousarray(parameters, float), table(samples), CONE, SHAPE, lens(picture.camera), gradient, step
    )
    return result


@dataclass(frozen=True)
class EdgePoints:
    """Points (n, 2) on edges in the picture; the blade (n,), side (n,) and station (n,) where
    each was looked for, the direction (n, 2) across the edge, and whether there is a step of brightness at all."""

    points: Array
    blade: NDArray[np.int64]
    side: NDArray[np.int64]
    share: NDArray[np.int64]
    across: Array
    real: NDArray[np.bool_]

    def only(self, keep: NDArray[np.bool_]) -> EdgePoints:
        """Those of them."""
        return EdgePoints(
            self.points[keep],
            self.blade[keep],
            self.side[keep],
            self.share[keep],
            self.across[keep],
            self.real[keep],
        )


def edge_points(picture: Picture, parameters: Array, reach: float) -> EdgePoints:
    """The strongest step across each edge of a rotor (12,), within `reach` px of where the model has it."""
    edges = outline(parameters[None], SAMPLES, picture.camera)[0]
    half = picture.camera.centre - 3 - reach
    shifts = np.arange(-reach - 1, reach + 2)
    blade, side, share = np.nonzero(np.all(np.abs(edges) < half, axis=-1))
    middle = edges[blade, side, share]
    step = np.gradient(edges, axis=2)[blade, side, share]
    along = step / np.linalg.norm(step, axis=-1, keepdims=True)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    if len(middle) == 0:
        return EdgePoints(middle, blade, side, share, across, np.zeros(0, bool))
    values = picture.at(middle[:, None, :] + shifts[:, None] * across[:, None, :])
    slope = values[:, 2:] - values[:, :-2]
    same = (blade[1:] == blade[:-1]) & (side[1:] == side[:-1])
    summed = slope.copy()
    summed[1:][same] += slope[:-1][same]
    summed[:-1][same] += slope[1:][same]
    size = np.linalg.norm(summed, axis=2) / 3
    best = np.argmax(size[:, 1:-1], axis=1) + 1
    rows = np.arange(len(middle))
    before, peak, after = size[rows, best - 1], size[rows, best], size[rows, best + 1]
    bend = np.minimum(before - 2 * peak + after, -1e-9)
    offset = shifts[1:-1][best] + np.clip(0.5 * (before - after) / bend, -0.5, 0.5)
    return EdgePoints(middle + offset[:, None] * across, blade, side, share, across, peak > 3 * picture.noise)


def _residuals(parameters: Array, edges: EdgePoints, camera: Camera) -> Array:
    """Distance (n,) of edge points from the model's edges, then (9,) what is known of any rotor, in units of their
    sigma."""
    model = outline(parameters[None], SAMPLES, camera)[0]
    off = ((edges.points - model[edges.blade, edges.side, edges.share]) * edges.across).sum(axis=1) / EDGE_PX
    result: Array = np.concatenate([off, surprise(parameters[None], camera)[0] * np.sqrt(NEIGHBOURS)])
    return result
