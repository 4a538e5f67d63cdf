"""The true numbers of a simulated flight, computed in this one place from what truly happened, never from an estimate.

Clearance is the distance of the vehicle's reference point from the nearest surface of the turbine; standoff the
distance of the left lens from the nearest surface of the inspected blade. Distances are exact to the simulated
turbine's triangles (rounding apart) and are taken at the truth's own samples, 20 a second: between two of them a
vehicle at 3 m/s can have been up to 4 mm nearer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from devices.world.nearest import distances
from devices.world.raycast import cast
from devices.world.silhouette import edges, outlines
from devices.world.turbine import BLADES, INSPECTED, TurbineShape
from vision.camera import Camera
from vision.capture import CameraPose, camera_pose, rotation_of

Array = NDArray[np.float64]
Side = Literal["leading", "trailing"]

COLLISION_M = 0.6  # half the span of the simulated vehicle's frame with its propellers
SHARP = 0.3  # sharpness below which a frame does not count
STATION_STEP_M = 0.1
FOLLOWED_M = 8.0  # a blade that is followed is nearer than this
SELF_M = 0.5  # the blade itself hides an edge point only from farther away than this along the ray


@dataclass(frozen=True)
class Flight:
    """What truly happened: t (n,) mission seconds, position (n, 3) m in local NED, attitude (n, 3) roll, pitch, yaw and
    gimbal (n, 2) yaw, pitch rad, armed (n,)."""

    t: Array
    position: Array
    attitude: Array
    gimbal: Array
    armed: NDArray[np.bool_]

    def camera(self, t: float, mount: Array) -> CameraPose:
        """True pose of the left camera at a mission time, interpolated; mount (3,) m: the lens in body axes."""
        after = int(np.clip(np.searchsorted(self.t, t), 1, len(self.t) - 1))
        span = self.t[after] - self.t[after - 1]
        share = float(np.clip((t - self.t[after - 1]) / span, 0.0, 1.0)) if span > 0 else 1.0

        def between(values: Array, turns: bool) -> Array:
            step = values[after] - values[after - 1]
            if turns:
                step = (step + np.pi) % (2 * np.pi) - np.pi
            result: Array = values[after - 1] + share * step
            return result

        position, attitude = between(self.position, False), between(self.attitude, True)
        return camera_pose(position, attitude, between(self.gimbal, True), mount)


@dataclass(frozen=True)
class Pass:
    """A stretch of time (mission seconds) in which one side of the blade was followed."""

    start_s: float
    end_s: float
    side: str


@dataclass(frozen=True)
class Photograph:
    """A recorded frame that counts: sharp and accepted. blade: 0 for the first that was inspected, then clockwise."""

    stamp_s: float
    side: str
    blade: int = 0


def flight_truth(
    flight: Flight,
    shape: TurbineShape,
    camera: Camera,
    mount: Array,
    passes: Sequence[Pass] = (),
    photographs: Sequence[Photograph] = (),
    target_m: float | None = None,
    tip_radius_m: float | None = None,
) -> Mapping[str, Any]:
    """The `truth` section of a run's summary; a number is None where the run has nothing to compute it from.

    min_clearance_m: over the armed flight. collision: the frame touched the turbine. standoff_*: over the passes, the
    RMSE against `target_m`. tip_error_m: of the claimed radius. coverage: see `coverage`, of all
    blades of which there are photographs, and of each where there are several.
    """
    armed = flight.position[flight.armed]
    nearest = float(distances(shape.mesh, armed).min()) if len(armed) else None
    lens = _lens(flight, mount)
    standoff = _standoff(flight, shape, lens, passes)
    error = standoff - target_m if target_m is not None and len(standoff) else None
    sides = sorted({one.side for one in passes} | {one.side for one in photographs})
    blades = []
    for number in range(1 + max((one.blade for one in photographs), default=0)):
        turned = replace(shape, azimuth_deg=shape.azimuth_deg + 120.0 * number)
        own = [one for one in photographs if one.blade == number]
        blades.append({side: coverage(flight, turned, camera, mount, own, side) for side in sides})
    return {
        "min_clearance_m": nearest,
        "collision": nearest is not None and nearest < COLLISION_M,
        "standoff_rmse_m": float(np.sqrt(np.mean(error**2))) if error is not None else None,
        "standoff_min_m": float(standoff.min()) if len(standoff) else None,
        "standoff_max_m": float(standoff.max()) if len(standoff) else None,
        "tip_error_m": None if tip_radius_m is None else abs(tip_radius_m - shape.blade.tip_radius_m),
        "coverage": {side: sum(blade[side] for blade in blades) / len(blades) for side in sides},
        **({"blades": [{"coverage": blade} for blade in blades]} if len(blades) > 1 else {}),
    }


def _standoff(flight: Flight, shape: TurbineShape, lens: Array, passes: Sequence[Pass]) -> Array:
    """Distances (n,) of the lens from the blade during the passes. A mission may take several blades in turn: a pass
    belongs to the blade that it was nearest to, by the median."""
    found: list[Array] = []
    for one in passes:
        during = lens[(flight.t >= one.start_s) & (flight.t <= one.end_s)]
        if len(during) == 0:
            continue
        best = distances(shape.mesh, during, (INSPECTED,))
        for other in BLADES[1:]:
            # Near the hub all three are near; a pass over half a blade is unmistakable.
            if np.median(best) > FOLLOWED_M:
                candidate = distances(shape.mesh, during, (other,))
                best = candidate if np.median(candidate) < np.median(best) else best
        found.append(best)
    return np.concatenate(found) if found else np.empty(0)


def _lens(flight: Flight, mount: Array) -> Array:
    """Positions (n, 3) of the left lens."""
    lens: Array = np.array(
        [place + rotation_of(*angles) @ mount for place, angles in zip(flight.position, flight.attitude, strict=True)]
    ).reshape(-1, 3)
    return lens


def coverage(
    flight: Flight, shape: TurbineShape, camera: Camera, mount: Array, photographs: Sequence[Photograph], side: str
) -> float:
    """Share of the span whose true edge of that side lies, unhidden, inside a photograph taken of that side.

    The span runs from where the blade leaves the spinner to its outermost point. The edge is the silhouette as the
    camera truly saw it: of each section's outline the point farthest to that side in the image."""
    root, tip = shape.visible_root_m, shape.blade.tip_radius_m
    stations = np.linspace(root, tip - 0.02, int(np.ceil((tip - root) / STATION_STEP_M)) + 1)
    outline = outlines(shape, stations)
    seen = np.zeros(len(stations), bool)
    for one in photographs:
        if one.side == side:
            pose = flight.camera(one.stamp_s, mount)
            near = np.abs(shape.blade_frame().to_blade(pose.position)[0] - stations) < 25.0
            new = np.flatnonzero(near & ~seen)
            seen[new[_edge_seen(shape, outline[new], camera, pose, side)]] = True
    return float(seen.mean())


def _edge_seen(shape: TurbineShape, outline: Array, camera: Camera, pose: CameraPose, side: str) -> NDArray[np.bool_]:
    """Which of the sections (n, m, 3) show their edge of that side to the camera."""
    if len(outline) == 0:
        return np.zeros(0, bool)
    at, points = edges(shape, outline, camera, pose, side)
    with np.errstate(invalid="ignore"):
        inside = np.all((at >= 0) & (at <= [camera.width - 1, camera.height - 1]), axis=1)
    offset = points - pose.position
    length = np.linalg.norm(offset, axis=1)
    distance, hit = cast(shape.mesh, pose.position, offset / length[:, None], length - 0.05)
    part = shape.mesh.part[np.maximum(hit, 0)]
    hidden = (hit >= 0) & ((part != INSPECTED) | (distance < length - SELF_M))
    result: NDArray[np.bool_] = inside & ~hidden
    return result


def truth_of_run(*folders: Path) -> Mapping[str, Any] | None:
    """`flight_truth` of a run's folder, or of several that go on with one another, oldest first; None where they do not
    hold what it takes (no simulated vehicle)."""
    from devices.world.run_files import RunFiles, joined

    run = joined([run for folder in folders if (run := RunFiles.read(folder)) is not None])
    if run is None:
        return None
    return flight_truth(
        run.flight, run.shape, run.camera, run.mount, run.passes, run.photographs, run.target_m, run.tip_radius_m
    )
