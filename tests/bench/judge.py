"""Holds one observation against the truth of its scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from devices.scenes import BladePiece, Scene
from devices.scenes.truth import EdgeTruth, SceneTruth
from vision.observation import BladeObservation, Dots, Edge

SAME_DOT_PX = 2.0  # of a 612 pixels wide image: nearer than that a spot of the right index is the dot
SAME_DIRECTION = 0.005  # of the tangent, between a point and its true dot
VISIBLE_PX = 120.0  # a shorter stretch of an edge need not be found


@dataclass(frozen=True)
class Verdict:
    """One scene. Pixels are of a 2448 pixels wide image, as the figures asked for are; lengths in metres.

    dots_*: counts of true dots on the blade, found among them, reported, wrong. dot_px: their errors. depth_error:
    relative, of the mean distance, depth_z: over its claimed sigma. points: (error, claimed sigma) in metres of the
    depth of every single point. edge_errors: (degrees, px) of every reported edge, edges_due: how many ought to be
    found. heading_deg: error. tip_m: error along the axis, NaN where a tip in view was missed, None where there is
    none; false_tip. unsaid: an edge off by more than 3° or a distance by more than 10 % while valid. angle_deg: of the
    blade.
    """

    view: str
    angle_deg: float
    valid: bool
    dots_true: int
    dots_found: int
    dots_reported: int
    dots_wrong: int
    matches: int
    matches_wrong: int
    dot_px: tuple[float, ...]
    depth_error: float | None
    depth_z: float | None
    edge_errors: tuple[tuple[float, float], ...]
    edge_z: tuple[tuple[float, float], ...]
    edges_due: int
    heading_deg: float | None
    tip_m: float | None
    false_tip: bool
    unsaid: bool
    distance_m: float = 0.0
    baseline_m: float = 0.0
    points: tuple[tuple[float, float], ...] = ()

    @property
    def edges_right(self) -> bool:
        """Every edge that is due was found within 1° and 8 px, and none besides."""
        right = sum(degrees < 1 and px < 8 for degrees, px in self.edge_errors)
        return right >= self.edges_due and right == len(self.edge_errors)


def judge(scene: Scene, seen: BladeObservation) -> Verdict:
    """The verdict on one observation."""
    truth, settings = scene.truth, scene.settings
    to_full = 4 / settings.scale
    on_blade = {
        (int(r), int(c))
        for r, c, blade, uv in zip(truth.row, truth.column, truth.on_blade, truth.uv_left, strict=True)
        if blade and np.isfinite(uv[0])
    }
    errors, right, wrong = _dots(seen.dots_left, truth.dots("left"), SAME_DOT_PX * settings.scale)
    _, right_eye, wrong_eye = _dots(seen.dots_right, truth.dots("right"), SAME_DOT_PX * settings.scale)
    depth = seen.distance_m / truth.distance_m - 1 if seen.distance_m else None
    pairs = [(edge, _nearest(edge, truth.edges)) for edge in seen.edges]
    edge_errors = tuple(_edge_error(edge, true, to_full) for edge, true in pairs)
    edge_z = tuple(
        (np.deg2rad(error[0]) / edge.sigma_theta, error[1] / to_full / edge.sigma_rho_px)
        for (edge, _), error in zip(pairs, edge_errors, strict=True)
        if error[0] < 3
    )
    along = BladePiece(settings).along
    heading = truth.heading if len(seen.edges) != 1 else float(np.arctan2(along[2], along[1]))
    turned = None if seen.heading is None else abs(np.rad2deg(np.angle(np.exp(2j * (seen.heading - heading))))) / 2
    tip = None
    if truth.tip_point_px is not None:
        tip = float("nan")
        if seen.tip is not None:
            axis = np.array([np.cos(truth.heading), np.sin(truth.heading)])
            pixel_m = settings.distance_m / (616 * settings.scale)
            tip = float((seen.tip.point - truth.tip_point_px) @ axis) * pixel_m
    off = any(degrees > 3 for degrees, _ in edge_errors) or (depth is not None and abs(depth) > 0.1)
    return Verdict(
        view=settings.view,
        angle_deg=float(np.rad2deg(settings.angle)),
        valid=seen.valid,
        dots_true=len(on_blade),
        dots_found=len(on_blade & right),
        dots_reported=0 if seen.dots_left is None else len(seen.dots_left),
        dots_wrong=wrong,
        matches=len(right_eye) + wrong_eye,
        matches_wrong=wrong_eye,
        dot_px=tuple((errors * to_full).ravel().tolist()),
        depth_error=depth,
        depth_z=None if depth is None else (seen.distance_m - truth.distance_m) / seen.distance_sigma_m,  # type: ignore[operator]
        edge_errors=edge_errors,
        edge_z=edge_z,
        edges_due=sum(edge.visible_px > VISIBLE_PX * settings.scale for edge in truth.edges),
        heading_deg=turned,
        tip_m=tip,
        false_tip=truth.tip_point_px is None and seen.tip is not None,
        unsaid=seen.valid and off,
        distance_m=truth.distance_m,
        baseline_m=settings.baseline_m,
        points=_points(seen, truth),
    )


def _dots(found: Dots | None, true: Dots, within: float) -> tuple[np.ndarray, set[tuple[int, int]], int]:
    places = {(int(r), int(c)): uv for uv, r, c in zip(true.uv, true.row, true.column, strict=True)}
    errors, right, wrong = [], set(), 0
    if found is not None:
        for uv, r, c in zip(found.uv, found.row.tolist(), found.column.tolist(), strict=True):
            if (r, c) in places and np.hypot(*(uv - places[r, c])) < within:
                errors.append(uv - places[r, c])
                right.add((r, c))
            else:
                wrong += 1
    return np.array(errors).reshape(-1, 2), right, wrong


def _points(seen: BladeObservation, truth: SceneTruth) -> tuple[tuple[float, float], ...]:
    """Error and claimed sigma of the depth of each point, against the true dot in the same direction."""
    if seen.points is None or seen.sigma_m is None or not truth.on_blade.any():
        return ()
    true = truth.points[truth.on_blade]
    sight, true_sight = seen.points[:, 1:] / seen.points[:, :1], true[:, 1:] / true[:, :1]
    apart = np.hypot(*(sight[:, None] - true_sight).transpose(2, 0, 1))
    nearest = apart.argmin(axis=1)
    same = apart.min(axis=1, initial=np.inf) < SAME_DIRECTION
    errors = seen.points[:, 0] - true[nearest, 0]
    return tuple(zip(errors[same].tolist(), np.asarray(seen.sigma_m)[same].tolist(), strict=True))


def _nearest(edge: Edge, true: tuple[EdgeTruth, ...]) -> EdgeTruth | None:
    return max(true, key=lambda one: float(one.outward @ edge.outward), default=None)


def _edge_error(edge: Edge, true: EdgeTruth | None, to_full: float) -> tuple[float, float]:
    if true is None:
        return 180.0, 1e4
    turned = float(np.rad2deg(np.arccos(np.clip(float(edge.outward @ true.outward), -1, 1))))
    signed = [
        line.rho * float(np.array([np.cos(line.theta), np.sin(line.theta)]) @ outward)
        for line, outward in ((edge.line, edge.outward), (true.line, true.outward))
    ]
    return turned, abs(signed[0] - signed[1]) * to_full
