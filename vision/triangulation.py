"""Where hub and rotor stand, from pictures taken in several places: rays that meet, and directions of blades."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from vision.camera import Camera
from vision.capture import CameraPose, rotation_of
from vision.observation import FarView

Array = NDArray[np.float64]

ATTITUDE_SIGMA = 0.002  # rad, of the camera's angles as telemetry reports them, beside the compass's constant error
COMPASS_SIGMA = np.deg2rad(1.5)
SAME_PLACE_M = 1.5  # pictures taken nearer to one another than this err together
OUTLIER = 4.0  # sigmas beyond which a picture contradicts the others
THIRD = 2 * np.pi / 3


@dataclass(frozen=True)
class RotorBelief:
    """What is believed of the rotor before: hub (3,) m in local NED and heading (rad, from the front to the back), each
    with its sigma; tilt (nose up) and cone (blades forward) in radians, taken as known."""

    hub: Array
    hub_sigma_m: float
    heading: float
    heading_sigma: float
    tilt: float = np.deg2rad(5.0)
    cone: float = np.deg2rad(2.0)


@dataclass(frozen=True)
class HubFix:
    """The hub's centre (3,) m in local NED with its covariance (3, 3) m², how far the bearings miss it in px (rms),
    which bearings were used (n,), and why it cannot be relied on."""

    position: Array
    covariance: Array
    residual_px: float
    used: NDArray[np.bool_]
    valid: bool
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True)
class RotorFix:
    """Hub, azimuths (3,) of the three blades in the rotor's plane (rad, clockwise from up as seen from the front,
    ascending in [0, 2π)) with one sigma, and heading; heading_observed: the pictures told it better than it was known
    before. compass_error: what all yaws have too much, rad, as far as pictures from different distances tell."""

    hub: HubFix
    azimuths: Array
    azimuth_sigma: float
    heading: float
    heading_sigma: float
    heading_observed: bool
    valid: bool
    reasons: tuple[str, ...] = ()
    compass_error: float = 0.0

    def azimuth_near(self, expected: float) -> float:
        """The azimuth of the blade nearest to an expected one: three blades alike cannot be told apart by sight."""
        return float(self.azimuths[np.argmax(np.cos(self.azimuths - expected))])


def locate_hub(
    bearings: Sequence[tuple[CameraPose, Array]],
    camera: Camera,
    *,
    sigma_px: float | Sequence[float] = 1.5,
    prior: tuple[Array, float] | None = None,
) -> HubFix:
    """Least-squares intersection of rays. bearings: pose and the hub (2,) in the image frame of each picture; prior: a
    point (3,) m in local NED and its sigma, as surveyed, which also stands in for what the bearings leave open."""
    poses = [pose for pose, _ in bearings]
    pixels = np.array([pixel for _, pixel in bearings], float).reshape(-1, 2)
    sigmas = np.broadcast_to(np.asarray(sigma_px, float), len(poses))
    used = np.isfinite(pixels).all(axis=1)
    if used.sum() < (1 if prior is not None else 2):
        start = prior[0] if prior is not None else np.full(3, np.nan)
        sigma = prior[1] if prior is not None else np.inf
        return HubFix(
            np.asarray(start, float), np.diag(np.full(3, sigma**2)), np.inf, used, False, ("too few bearings",)
        )
    start = np.asarray(prior[0], float) if prior is not None else _crossing(poses, pixels, camera)
    weights = _weights(poses, sigmas, camera, start)

    def residuals(point: Array, keep: NDArray[np.bool_]) -> Array:
        off = [(_seen(camera, poses[i], point) - pixels[i]) * weights[i] for i in np.flatnonzero(keep)]
        belief = [(point - prior[0]) / prior[1]] if prior is not None else []
        return np.concatenate([*off, *belief])

    point, covariance, used = _fit(residuals, start, used, 2)
    miss = np.array([_seen(camera, poses[i], point) - pixels[i] for i in np.flatnonzero(used)])
    rms = float(np.sqrt(np.mean(miss**2)))
    reasons = _hub_doubts(point, covariance, used, prior)
    return HubFix(point, covariance, rms, used, not reasons, reasons)


def locate_rotor(views: Sequence[tuple[CameraPose, FarView]], camera: Camera, belief: RotorBelief) -> RotorFix:
    """Hub, azimuths and heading that the valid pictures of the rotor agree on, given what was believed before."""
    good = [(pose, view) for pose, view in views if view.valid and view.hub is not None and view.directions is not None]
    if not good:
        prior = np.eye(3) * belief.hub_sigma_m**2
        nowhere = HubFix(belief.hub, prior, np.inf, np.zeros(0, bool), False, ("no picture",))
        text = "no picture shows the rotor"
        return RotorFix(
            nowhere, np.full(3, np.nan), np.inf, belief.heading, belief.heading_sigma, False, False, (text,)
        )
    poses = [pose for pose, _ in good]
    hubs = np.array([view.hub for _, view in good])
    sigmas = [view.hub_sigma_px or 2.0 for _, view in good]
    bearings = list(zip(poses, hubs, strict=True))
    fix = locate_hub(bearings, camera, sigma_px=sigmas, prior=(belief.hub, belief.hub_sigma_m))
    weights = _weights(poses, np.array(sigmas), camera, fix.position)
    spread = np.array(
        [np.broadcast_to(0.01 if view.direction_sigma is None else view.direction_sigma, 3) for _, view in good]
    )
    turn_weights = 1 / (np.hypot(spread, ATTITUDE_SIGMA) * np.sqrt(_crowd(poses))[:, None])
    seen = np.array([view.directions for _, view in good])

    def residuals(x: Array, keep: NDArray[np.bool_]) -> Array:
        off = []
        for i in np.flatnonzero(keep):
            pose = turned(poses[i], -x[5])
            off.append((_seen(camera, pose, x[:3]) - hubs[i]) * weights[i])
            expected = blade_directions(camera, pose, x[:3], x[3], x[4], belief.tilt, belief.cone)
            gap = _wrapped(seen[i][:, None] - expected[None])
            off.append(np.take_along_axis(gap, np.abs(gap).argmin(axis=1)[:, None], 1)[:, 0] * turn_weights[i])
        off.append((x[:3] - belief.hub) / belief.hub_sigma_m)
        off.append(np.array([_wrapped(x[3] - belief.heading) / belief.heading_sigma, x[5] / COMPASS_SIGMA]))
        return np.concatenate(off)

    # A blade that points up is seen at -90° in the image; the rest of the way is small and found by the fit.
    first = float(np.angle(np.exp(3j * (seen + np.pi / 2)).sum()) / 3)
    start = np.array([*fix.position, belief.heading, first, 0.0])
    x, covariance, used = _fit(residuals, start, fix.used.copy(), 5)
    miss = np.array([_seen(camera, turned(poses[i], -x[5]), x[:3]) - hubs[i] for i in np.flatnonzero(used)])
    reasons = _hub_doubts(x[:3], covariance[:3, :3], used, (belief.hub, belief.hub_sigma_m))
    hub = HubFix(x[:3], covariance[:3, :3], float(np.sqrt(np.mean(miss**2))), used, not reasons, reasons)
    sigma = float(np.sqrt(covariance[4, 4]))
    if sigma > np.deg2rad(3):
        reasons = (*reasons, f"the blades' azimuth is known to ±{np.degrees(sigma):.1f}° only")
    azimuths = np.sort((x[4] + THIRD * np.arange(3)) % (2 * np.pi))
    heading_sigma = float(np.sqrt(covariance[3, 3]))
    observed = heading_sigma < 0.7 * belief.heading_sigma
    heading = float(_wrapped(x[3]))
    return RotorFix(hub, azimuths, sigma, heading, heading_sigma, observed, not reasons, reasons, float(x[5]))


def turned(pose: CameraPose, yaw: float) -> CameraPose:
    """The pose with the camera turned by `yaw` (rad, clockwise from above) where it is."""
    return CameraPose(pose.position, rotation_of(0.0, 0.0, yaw) @ pose.rotation, pose.sigma_m)


def blade_directions(
    camera: Camera, pose: CameraPose, hub: Array, heading: float, azimuth: float, tilt: float, cone: float
) -> Array:
    """Directions (3,) in the image, radians clockwise from +y_im, of the axes of blades at azimuth, + 120° and +
    240°."""
    x, y, z = rotation_of(0.0, -tilt, heading).T
    turns = azimuth + THIRD * np.arange(3)[:, None]
    span = np.cos(cone) * (np.sin(turns) * y - np.cos(turns) * z) - np.sin(cone) * x
    points = camera.project(pose.from_ned(np.vstack([hub, hub + span])))
    step = points[1:] - points[0]
    return np.asarray(np.arctan2(step[:, 1], step[:, 0]), float)


def _seen(camera: Camera, pose: CameraPose, point: Array) -> Array:
    """Where a point (3,) is in the image frame (2,); far outside where it is behind the lens."""
    pixel = camera.project(pose.from_ned(point))[0] - camera.centre
    return np.where(np.isfinite(pixel), pixel, 1e4)


def _crowd(poses: Sequence[CameraPose]) -> Array:
    """(n,): how many pictures were taken in the same place as each."""
    places = np.array([pose.position for pose in poses])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    return np.asarray((apart < SAME_PLACE_M).sum(axis=1), float)


def _weights(poses: Sequence[CameraPose], sigmas_px: Array, camera: Camera, hub: Array) -> Array:
    """1/sigma (n,) of a bearing in px: of the picture, of the camera's angles and of its position together."""
    far = np.array([max(float(np.linalg.norm(hub - pose.position)), 1.0) for pose in poses])
    place = np.array([pose.sigma_m for pose in poses]) / far
    sigma = np.sqrt(sigmas_px**2 + camera.fx**2 * (ATTITUDE_SIGMA**2 + place**2))
    return np.asarray(1 / (sigma * np.sqrt(_crowd(poses))), float)


def _crossing(poses: Sequence[CameraPose], pixels: Array, camera: Camera) -> Array:
    """The point (3,) nearest to all rays."""
    matrix, right = np.zeros((3, 3)), np.zeros(3)
    for pose, pixel in zip(poses, pixels, strict=True):
        if not np.isfinite(pixel).all():
            continue
        ray = pose.rotation @ camera.rays(pixel[None] + camera.centre)[0]
        ray /= np.linalg.norm(ray)
        across = np.eye(3) - np.outer(ray, ray)
        matrix += across
        right += across @ pose.position
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], float)


def _fit(
    residuals: Callable[[Array, NDArray[np.bool_]], Array], start: Array, used: NDArray[np.bool_], each: int
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Fit, leaving out the picture that contradicts the others most until none does or half are left."""
    least = max(2, int(np.ceil(used.sum() / 2)))
    while True:
        robust = least_squares(residuals, start, args=(used,), loss="soft_l1", x_scale="jac")
        off = residuals(robust.x, used)[: each * int(used.sum())].reshape(-1, each)
        # Weights are shared among pictures of one place; a single picture is judged by its own sigma at least.
        worst = np.abs(off).max(axis=1)
        if len(worst) <= least or worst.max() < OUTLIER:
            break
        used = used.copy()
        used[np.flatnonzero(used)[worst.argmax()]] = False
    solution = least_squares(residuals, robust.x, args=(used,), x_scale="jac")
    count, values = len(solution.fun), len(start)
    scale = max(1.0, float(2 * solution.cost) / max(count - values, 1))
    jacobian = np.asarray(solution.jac, float)
    return solution.x, np.linalg.pinv(jacobian.T @ jacobian) * scale, used


def _hub_doubts(
    point: Array, covariance: Array, used: NDArray[np.bool_], prior: tuple[Array, float] | None
) -> tuple[str, ...]:
    reasons = []
    sigma = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    if not sigma < 2.0:
        reasons.append(f"the pictures leave the hub uncertain by ±{sigma:.1f} m")
    if used.sum() < 0.6 * len(used):
        reasons.append(f"only {int(used.sum())} of {len(used)} pictures agree")
    if prior is not None:
        shift = float(np.linalg.norm(point - prior[0]))
        if shift > 4 * prior[1]:
            reasons.append(f"the hub would be {shift:.1f} m from where it was surveyed")
    return tuple(reasons)


def _wrapped(angle: Array) -> Array:
    result: Array = (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi
    return result
