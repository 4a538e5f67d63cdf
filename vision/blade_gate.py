"""Which parts of an observation fit the tracked blade, and the blade corrected by them (6.3 to 6.7)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from vision.blade_measurement import Measurement, measure, side_of
from vision.blade_model import BladeModel
from vision.blade_motion import EDGE, PLANE, SIDES, SLOPES, Side
from vision.camera import Camera
from vision.capture import CameraPose
from vision.estimate import BladeFrame
from vision.observation import BladeObservation, Edge
from vision.tracker_settings import TrackerSettings
from vision.tremble import Tremble

Array = NDArray[np.float64]


@dataclass(frozen=True)
class UpdateResult:
    """What became of one observation: whether its surface was used, the parts used ('surface', 'leading', 'trailing'),
    the normalised innovation squared of those parts with its degrees of freedom, and why anything was refused.
    part_nis: of each part, an edge's given the surface; refused_m: how far outward of the tracked edge a refused one
    lies."""

    accepted: bool
    parts: tuple[str, ...] = ()
    nis: float = float("nan")
    dof: int = 0
    reasons: tuple[str, ...] = ()
    part_nis: Mapping[str, float] = field(default_factory=dict)
    refused_m: Mapping[Side, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Judged:
    """An observation before the gates: the result, the model as the camera ought to have shown it, and, unless the
    surface was refused, the model corrected by those parts that passed, and the measurement that they make."""

    result: UpdateResult
    before: BladeModel
    after: BladeModel | None = None
    used: Measurement | None = None


@dataclass(frozen=True)
class BladeGate:
    """Judges observations that a camera took of the blade in a frame."""

    camera: Camera
    frame: BladeFrame
    settings: TrackerSettings

    def correct(
        self,
        model: BladeModel,
        observation: BladeObservation,
        pose: CameraPose,
        tremble: Tremble,
        late_s: float = 0.0,
    ) -> Judged:
        """The model corrected by what of this observation passes. The surface faces its χ² gate first, the edges theirs
        given the surface; without the surface nothing is used. late_s: how long before the model's time it was
        taken."""
        settings = self.settings
        there = self.meets(observation, pose)
        low, high = sorted(float(model.mean[EDGE[side].start]) for side in SIDES)
        aside = max(low - there[1], there[1] - high)
        if aside > settings.largest_chord_m:
            return Judged(UpdateResult(False, reasons=(f"what is seen lies {aside:.1f} m beside the blade",)), model)
        model = model.seen_from(self.frame.to_blade(pose.position)).moved(there[0], there[1], settings)
        surface = self._measure(observation, {}, pose, model, tremble, late_s)
        nis, dof = innovation(model, surface, ["surface"])
        leans: list[str] = []
        if dof > 1 and not nis < bound(settings.gate, dof):
            # A bend within the dots makes a surface lean otherwise without being elsewhere; should it go on leaning so,
            # the slopes, half as certain each time, give way.
            alone = replace(observation, normal=None)
            distance = self._measure(alone, {}, pose, model, tremble, late_s)
            if innovation(model, distance, ["surface"])[0] < bound(settings.gate, 1):
                leans = ["the surface leans otherwise than the tracked one"]
                observation, surface = alone, distance
                model = model.inflated(SLOPES, np.sqrt(3 * np.diag(model.covariance)[SLOPES]))
                nis, dof = innovation(model, surface, ["surface"])
        if not nis < bound(settings.gate, dof):
            deeper = float(surface.z[0] - surface.H[0] @ model.mean)
            where = "behind" if deeper > 0 else "before"
            text = f"the surface lies {abs(deeper):.2f} m {where} the tracked one or leans otherwise"
            return Judged(UpdateResult(False, nis=nis, dof=dof, reasons=(text,), part_nis={"surface": nis}), model)
        # Where the surface was uncertain, edges are linearised around what it has just become.
        around = replace(model, mean=model.corrected(surface.z, surface.R, surface.H).mean)
        edges, reasons = self._sides(observation, pose, around, tremble, late_s)
        reasons = leans + reasons
        joint = self._measure(observation, edges, pose, around, tremble, late_s)
        if len(edges) == 2 and not width(joint, around) > 0:
            edges, joint = {}, surface
            reasons.append("the edges lie the wrong way round")
        part_nis = {"surface": nis}
        off: dict[Side, float] = {}
        for side in edges:
            part_nis[side] = innovation(model, joint, ["surface", side])[0] - nis
            if not part_nis[side] < bound(settings.gate, 2):
                off[side] = outward(joint, side, model)
                reasons.append(f"the {side} edge is seen {abs(off[side]):.2f} m from where it is tracked")
        if len(edges) == 2 and not off:
            both = innovation(model, joint, ["surface", *edges])[0] - nis
            if not both < bound(settings.gate, 4):
                side = max(edges, key=lambda each: part_nis[each])
                off[side] = outward(joint, side, model)
                reasons.append(f"the {side} edge is seen too far from the other one")
        parts = ["surface", *(side for side in edges if side not in off)]
        rows = np.concatenate([np.r_[joint.parts[part]] for part in parts])
        nis, dof = innovation(model, joint, parts)
        used = joint.of(rows)
        corrected = model.corrected(used.z, used.R, used.H)
        return Judged(UpdateResult(True, tuple(parts), nis, dof, tuple(reasons), part_nis, off), model, corrected, used)

    def meets(self, observation: BladeObservation, pose: CameraPose) -> Array:
        """Where (station, offset, depth) the optical axis meets what was observed."""
        return self.frame.to_blade(pose.to_ned(np.array([observation.distance_m or 0.0, 0.0, 0.0])))

    def _measure(
        self,
        observation: BladeObservation,
        edges: dict[Side, Edge],
        pose: CameraPose,
        model: BladeModel,
        tremble: Tremble,
        late_s: float,
    ) -> Measurement:
        found = measure(observation, edges, pose, self.camera, self.frame, model, self.settings, tremble)
        return found.before(late_s, tremble.jitter_m, self.settings) if late_s > 0 else found

    def _sides(
        self, observation: BladeObservation, pose: CameraPose, model: BladeModel, tremble: Tremble, late_s: float
    ) -> tuple[dict[Side, Edge], list[str]]:
        """Edges by the side that their outward normals tell; of two on one side, the one nearer to what is tracked."""
        edges: dict[Side, Edge] = {}
        reasons: list[str] = []
        for edge in observation.edges:
            side = side_of(edge, self.camera, pose, self.frame, model)
            if side is None:
                reasons.append("an edge runs across the blade")
                continue
            if side in edges:
                reasons.append(f"two edges claim the {side} side")
                measured = [
                    self._measure(observation, {side: e}, pose, model, tremble, late_s) for e in (edges[side], edge)
                ]
                off = [abs(float(m.z[-2] - m.H[-2] @ model.mean)) for m in measured]
                if off[0] <= off[1]:
                    continue
            edges[side] = edge
        return edges, reasons


@lru_cache
def bound(share: float, dof: int) -> float:
    """What χ² of so many degrees of freedom stays under in this share of cases."""
    return float(chi2.ppf(share, dof))


def innovation(model: BladeModel, measurement: Measurement, parts: list[str]) -> tuple[float, int]:
    """Normalised innovation squared of some parts of a measurement, and its degrees of freedom."""
    rows = np.concatenate([np.r_[measurement.parts[part]] for part in parts])
    H = measurement.H[rows]
    innovation = measurement.z[rows] - H @ model.mean
    S = H @ model.covariance @ H.T + measurement.R[np.ix_(rows, rows)]
    return float(innovation @ np.linalg.solve(S, innovation)), len(rows)


def outward(measurement: Measurement, side: Side, model: BladeModel) -> float:
    """By how much farther along `across` an edge is measured than tracked (m)."""
    row = measurement.parts[side].start
    return float(measurement.z[row] - measurement.H[row] @ model.mean)


def width(measurement: Measurement, model: BladeModel) -> float:
    """From the measured trailing edge to the measured leading one, in metres along `across`."""
    offset = measurement.z - measurement.H[:, PLANE] @ model.mean[PLANE]
    return float(offset[measurement.parts["leading"].start] - offset[measurement.parts["trailing"].start])
