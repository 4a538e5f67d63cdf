"""The tracked blade as the left camera would see it from a given pose: distance, nearest point, edge lines, heading."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from vision.blade_model import BladeModel
from vision.blade_motion import ACROSS_SLOPE, BLADE, DEPTH, EDGE, PLANE, RECESS, SIDES, SIGN, Side
from vision.camera import Camera
from vision.capture import CameraPose
from vision.estimate import BladeEstimate, BladeFrame, SideEstimate
from vision.observation import Line
from vision.tracker_settings import TrackerSettings

Array = NDArray[np.float64]
REACH_M = 4.0  # an edge is drawn where it lies within this much of station of the point that is looked at


def view(
    model: BladeModel,
    frame: BladeFrame,
    pose: CameraPose,
    camera: Camera,
    stamp_s: float,
    ages: Mapping[str, float],
    lasting_m: float,
    settings: TrackerSettings,
) -> BladeEstimate:
    """The estimate at the model's reference point, which must lie where the camera looks (see `look_at`).

    ages: seconds since 'surface' and each side were last seen; a side without one has not been seen. The distance's
    sigma allows for the surface around the modelled plane, and for what is wrong with all dots together. What is seen
    from the lens (distances, lines) is as the camera shows it at this moment; what lies in local NED is without the
    trembling of the vehicle's position.
    """
    shown = model.as_shown()
    depth, along, across = model.mean[PLANE]
    here = np.array([model.station, model.offset, depth])
    lens = frame.to_blade(pose.position)
    axis = frame.rotation @ pose.rotation[:, 0]
    gradient = np.array([-along, -across, 1.0])
    steepness = max(float(axis @ gradient), 0.1)
    distance = float(np.linalg.norm(np.array([model.station, model.offset, shown.mean[DEPTH]]) - lens))
    together = float(np.interp(model.station, settings.round_within_m, settings.dots_per_m)) * distance**2
    left_out = np.square([settings.surface_sigma_m, together, lasting_m]).sum()
    distance_sigma = float(np.sqrt(shown.covariance[DEPTH, DEPTH] + left_out)) / steepness
    seen = {side: ages[side] for side in SIDES if side in ages}
    point = frame.to_ned(here)
    direction, sigma = heading(shown, seen, frame, pose)
    chord, chord_sigma = None, None
    if len(seen) == 2:
        width = np.zeros(len(model.mean))
        width[EDGE["leading"].start], width[EDGE["trailing"].start] = 1.0, -1.0
        slant = np.hypot(1.0, across)
        chord = float(width @ model.mean * slant)
        chord_sigma = float(np.sqrt(width @ model.covariance @ width) * slant)
    return BladeEstimate(
        stamp_s=stamp_s,
        age_s=ages["surface"],
        station_m=model.station,
        distance_m=distance,
        distance_sigma_m=distance_sigma,
        nearest_m=nearest(shown, seen, lens),
        normal=-(gradient @ frame.rotation) / np.linalg.norm(gradient),
        point=point,
        depth_m=float(depth),
        depth_slope=float(along),
        across_slope=float(across),
        leading=side_estimate("leading", model, shown, seen, frame, pose, camera),
        trailing=side_estimate("trailing", model, shown, seen, frame, pose, camera),
        heading=direction,
        heading_sigma=sigma,
        chord_m=chord,
        chord_sigma_m=chord_sigma,
        state=model.mean[BLADE],
        covariance=model.covariance[BLADE, BLADE],
    )


def edge_points(model: BladeModel, side: Side, stations: Array) -> Array:
    """Points (n, 3) of the surface at an edge, in blade coordinates."""
    offsets = np.array([model.edge_at(side, station) for station in stations])
    depths = [model.depth_at(station, offset) for station, offset in zip(stations, offsets, strict=True)]
    return np.column_stack([stations, offsets, depths])


def side_estimate(
    side: Side,
    model: BladeModel,
    shown: BladeModel,
    ages: Mapping[Side, float],
    frame: BladeFrame,
    pose: CameraPose,
    camera: Camera,
) -> SideEstimate | None:
    """One edge with the line it makes in the image of the blade as `shown`; None where it was never seen."""
    if side not in ages:
        return None
    offset, slope = model.mean[EDGE[side]]
    sigmas = np.sqrt(np.diag(model.covariance)[EDGE[side]])
    line, outward = edge_line(shown, side, frame, pose, camera)
    return SideEstimate(float(offset), float(slope), float(sigmas[0]), float(sigmas[1]), ages[side], line, outward)


def edge_line(
    model: BladeModel, side: Side, frame: BladeFrame, pose: CameraPose, camera: Camera
) -> tuple[Line | None, Array | None]:
    """The edge's line and outward normal (2,) in the image, (None, None) where it is behind the camera."""
    ends = edge_points(model, side, model.station + np.linspace(-REACH_M, REACH_M, 17))
    ends[:, 2] += model.mean[RECESS[side]]
    points = pose.from_ned(frame.to_ned(ends))
    pixels = camera.project(points[points[:, 0] > 0.3]) - camera.centre
    if len(pixels) < 2:
        return None, None
    nearest_to_centre = np.argsort(np.linalg.norm(pixels, axis=1))[:2]
    first, last = pixels[np.sort(nearest_to_centre)]
    step = last - first
    length = float(np.linalg.norm(step))
    if length < 1e-6:
        return None, None
    normal = np.array([-step[1], step[0]]) / length
    # Seen along the depth axis, leading lies to the right of the direction root to tip if span × across points to the
    # camera; a point a little further out settles it for any pose.
    middle = ends[np.flatnonzero(points[:, 0] > 0.3)[nearest_to_centre[0]]]
    further = middle + SIGN[side] * np.array([0.0, 1.0, model.mean[ACROSS_SLOPE]]) * 0.05
    out = camera.project(pose.from_ned(frame.to_ned(further)))[0] - camera.centre - first
    if not np.isfinite(out).all():
        return None, None
    outward = normal if normal @ out > 0 else -normal
    rho = float(outward @ first)
    towards = outward if rho >= 0 else -outward
    return Line(float(np.arctan2(towards[1], towards[0])), abs(rho)), outward


def heading(model: BladeModel, ages: Mapping[Side, float], frame: BladeFrame, pose: CameraPose) -> tuple[float, float]:
    """Direction from root to tip in the image (radians, on the circle) at the reference point, and its sigma."""
    slope = np.zeros(len(model.mean))
    for side in ages:
        slope[EDGE[side].start + 1] = 1.0 / len(ages)
    lean = float(slope @ model.mean)
    # With no edge seen, the blade runs along the frame's own span as far as the survey can be trusted.
    sigma = float(np.sqrt(slope @ model.covariance @ slope)) if ages else 0.1
    _, along, across = model.mean[PLANE]
    here = pose.from_ned(frame.to_ned(np.array([model.station, model.offset, model.mean[0]])))
    step = np.array([1.0, lean, along + across * lean]) @ frame.rotation @ pose.rotation
    in_image = step[1:] - step[0] * here[1:] / max(float(here[0]), 0.3)
    return float(np.arctan2(in_image[1], in_image[0])), sigma


def nearest(model: BladeModel, ages: Mapping[Side, float], lens: Array) -> float:
    """Distance (m) from the lens, in blade coordinates (3,), to the tracked surface between the edges that were
    seen."""
    depth, along, across = model.mean[PLANE]
    gradient = np.array([-along, -across, 1.0])
    reference = np.array([model.station, model.offset, depth])
    foot = lens - gradient * ((lens - reference) @ gradient) / (gradient @ gradient)
    for side in ages:
        if SIGN[side] * (foot[1] - model.edge_at(side, foot[0])) > 0:
            start, end = edge_points(model, side, np.array([model.station, model.station + 1.0]))
            step = end - start
            foot = start + step * ((lens - start) @ step) / (step @ step)
    return float(np.linalg.norm(lens - foot))
