"""The blade tracker: a Kalman filter that keeps the blade in a frame standing still, gates what vision reports, and
predicts it for now from any pose (chapter 6)."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from vision.blade_measurement import Measurement, look_at, measure, side_of
from vision.blade_model import (
    EDGE,
    PLANE,
    SIDES,
    BladeModel,
    Side,
    TrackerSettings,
    prior,
)
from vision.blade_view import view
from vision.camera import Camera
from vision.capture import CameraPose
from vision.estimate import BladeEstimate, BladeFrame
from vision.observation import BladeObservation, Edge

__all__ = ["BladeTracker", "Kept", "TrackerSettings", "UpdateResult", "lost"]

Array = NDArray[np.float64]
STEP_M = 0.1  # the reference follows the view in steps, so that a trembling camera adds no travel


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
class Kept:
    """What a tracker knows at one moment. stamp_s: of the last observation; seen_s: when each part was last seen."""

    model: BladeModel
    stamp_s: float
    seen_s: Mapping[str, float]


class BladeTracker:
    """Tracks one blade in one blade frame. Not for use from several threads at once.

    `update` with every observation and the pose *at its exposure*, `estimate` at every control tick.
    """

    def __init__(self, frame: BladeFrame, camera: Camera, settings: TrackerSettings | None = None) -> None:
        """camera: the left eye at the size of the pixels in which observations are given."""
        self.frame = frame
        self.camera = camera
        self.settings = settings or TrackerSettings()
        self.forget()

    def forget(self) -> None:
        """Drop everything that was seen; the survey's frame remains."""
        self._model: BladeModel | None = None
        self._challenger: BladeModel | None = None
        self._challenges = 0
        self._stamp_s = -np.inf
        self._taken_s: deque[float] = deque(maxlen=32)
        self._seen_s: dict[str, float] = {}
        self._challenger_seen_s: dict[str, float] = {}
        self._refused: dict[Side, list[float]] = {side: [] for side in SIDES}

    def kept(self) -> Kept | None:
        """What is known now, for another tracker to go on from; None before the blade is confirmed."""
        return None if self._model is None else Kept(self._model, self._stamp_s, dict(self._seen_s))

    def go_on_from(self, kept: Kept) -> None:
        """Forget, and know what another tracker of the same frame knew; it drifts and ages from its own stamps on."""
        self.forget()
        self._model, self._stamp_s, self._seen_s = kept.model, kept.stamp_s, dict(kept.seen_s)

    def forget_side(self, side: Side) -> None:
        """Drop one edge: it is as unknown as before it was first seen."""
        self._seen_s.pop(side, None)
        self._refused[side] = []
        if self._model is not None:
            self._model = self._model.without(side, self.settings)

    def age_s(self, stamp_s: float) -> float:
        """Seconds since the exposure of the last accepted observation, infinite before the first."""
        return stamp_s - self._seen_s.get("surface", -np.inf) if self._model is not None else np.inf

    def predict(self, stamp_s: float, pose: CameraPose) -> BladeModel | None:
        """The blade carried to this time and to where the camera looks now (6.1, 6.2); None before it is confirmed.

        What is kept stays where the last observation was: going back and forth for late ones would only add noise.
        """
        if self._model is None:
            return None
        model = self._until(self._model, stamp_s)
        station, offset, _ = look_at(pose, self.frame, model)
        return model.moved(station, offset, self.settings)

    def estimate(self, stamp_s: float, pose: CameraPose) -> BladeEstimate | None:
        """The blade predicted to `stamp_s` and seen from `pose`; None until observations have confirmed one another."""
        model = self.predict(stamp_s, pose)
        if model is None:
            return None
        ages = {part: max(stamp_s - seen_s, 0.0) for part, seen_s in self._seen_s.items()}
        return view(model, self.frame, pose, self.camera, stamp_s, ages)

    def update(self, observation: BladeObservation, pose: CameraPose) -> UpdateResult:
        """Use an observation taken from `pose` at its own stamp (6.3 to 6.7), also when a later one came first.

        The surface must pass its χ² gate before the edges, each given the surface, face theirs. A refused surface feeds
        a challenger; only a challenger that was confirmed often enough replaces what is tracked.
        """
        stamp_s = observation.stamp_s
        if not observation.valid or observation.distance_m is None:
            return UpdateResult(False, reasons=observation.reasons or ("vision gave no reason",))
        if stamp_s in self._taken_s:
            return UpdateResult(False, reasons=("the observation was already used",))
        if stamp_s < self._stamp_s - self.settings.history_s:
            return UpdateResult(False, reasons=(f"the observation is {self._stamp_s - stamp_s:.1f} s late",))
        self._taken_s.append(stamp_s)
        if self._model is None:
            return self._challenge(observation, pose, ("the blade is not confirmed yet",))
        model = self._until(self._model, stamp_s)
        result, corrected = self._correct(model, observation, pose)
        if corrected is None:
            self._stamp_s = max(self._stamp_s, stamp_s)
            self._model = model
            return self._challenge(observation, pose, result.reasons)
        self._model, self._stamp_s = self._edges_settled(corrected, result), max(self._stamp_s, stamp_s)
        self._challenger, self._challenges = None, 0
        for part in result.parts:
            self._seen_s[part] = max(stamp_s, self._seen_s.get(part, -np.inf))
        return result

    def _until(self, model: BladeModel, stamp_s: float) -> BladeModel:
        seconds = stamp_s - self._stamp_s
        return model.drifted(seconds, self.settings) if 0 < seconds < np.inf else model

    def _challenge(self, observation: BladeObservation, pose: CameraPose, reasons: tuple[str, ...]) -> UpdateResult:
        """A refused observation stands against what is tracked: the covariance grows, and a row of agreeing ones
        wins."""
        settings = self.settings
        there = self.frame.to_blade(pose.to_ned(np.array([observation.distance_m or 0.0, 0.0, 0.0])))
        result, corrected = UpdateResult(False), None
        if self._challenger is not None:
            result, corrected = self._correct(self._challenger.drifted(0.1, settings), observation, pose)
        if corrected is None:
            self._challenges = 0
            self._challenger_seen_s = {}
            result, corrected = self._correct(prior(there[0], there[1], settings), observation, pose)
            if corrected is None:
                self._challenger = None
                return UpdateResult(False, reasons=(*reasons, "nor is it where the survey allows a blade"))
        self._challenger = corrected
        self._challenges += 1
        self._challenger_seen_s |= dict.fromkeys(result.parts, observation.stamp_s)
        needed = settings.confirmations if self._model is None else settings.restart_after
        if self._challenges >= needed and self._may_replace(corrected):
            started = self._model is None
            self._model, self._stamp_s = corrected, max(self._stamp_s, observation.stamp_s)
            self._seen_s = dict(self._challenger_seen_s)
            self._challenger, self._challenges = None, 0
            text = () if started else (f"started again from {needed} agreeing observations",)
            return replace(result, reasons=(*result.reasons, *text))
        if self._model is not None and self._challenges > settings.patience:
            self._model = self._less_certain(self._model, PLANE)
        return UpdateResult(False, reasons=reasons, part_nis=result.part_nis)

    def _may_replace(self, challenger: BladeModel) -> bool:
        if self._model is None:
            return True
        behind = challenger.mean[0] - self._model.depth_at(challenger.station, challenger.offset)
        return bool(behind < self.settings.restart_deeper_m)

    def _less_certain(self, model: BladeModel, values: slice) -> BladeModel:
        settings = self.settings
        if np.sqrt(model.covariance[values.start, values.start]) > settings.inflation_limit_m:
            return model
        count = values.stop - values.start
        sigmas = np.array([settings.inflation_m, *[settings.inflation_slope] * (count - 1)])
        return model.inflated(values, sigmas)

    def _correct(
        self, model: BladeModel, observation: BladeObservation, pose: CameraPose
    ) -> tuple[UpdateResult, BladeModel | None]:
        """The model after this observation, or None where its surface does not pass the gate."""
        settings = self.settings
        there = self.frame.to_blade(pose.to_ned(np.array([observation.distance_m or 0.0, 0.0, 0.0])))
        if np.hypot(there[0] - model.station, there[1] - model.offset) > STEP_M:
            model = model.moved(there[0], there[1], settings)
        surface = measure(observation, {}, pose, self.camera, self.frame, model, settings)
        nis, dof = innovation(model, surface, ["surface"])
        if not nis < chi2.ppf(settings.gate, dof):
            deeper = float(surface.z[0] - surface.H[0] @ model.mean)
            where = "behind" if deeper > 0 else "before"
            text = f"the surface lies {abs(deeper):.2f} m {where} the tracked one or leans otherwise"
            return UpdateResult(False, nis=nis, dof=dof, reasons=(text,), part_nis={"surface": nis}), None
        # Where the surface was uncertain, edges are linearised around what it has just become.
        around = replace(model, mean=model.corrected(surface.z, surface.R, surface.H).mean)
        edges, reasons = self._sides(observation, pose, around)
        joint = measure(observation, edges, pose, self.camera, self.frame, around, settings)
        if len(edges) == 2 and not width(joint, around) > 0:
            edges, joint = {}, surface
            reasons.append("the edges lie the wrong way round")
        part_nis = {"surface": nis}
        off: dict[Side, float] = {}
        for side in edges:
            part_nis[side] = innovation(model, joint, ["surface", side])[0] - nis
            if not part_nis[side] < chi2.ppf(settings.gate, 2):
                row = joint.parts[side].start
                off[side] = float(joint.z[row] - joint.H[row] @ model.mean)
                reasons.append(f"the {side} edge is seen {abs(off[side]):.2f} m from where it is tracked")
        accepted = [side for side in edges if side not in off]
        parts = ["surface", *accepted]
        rows = np.concatenate([np.r_[joint.parts[part]] for part in parts])
        nis, dof = innovation(model, joint, parts)
        corrected = model.corrected(joint.z[rows], joint.R[np.ix_(rows, rows)], joint.H[rows])
        return UpdateResult(True, tuple(parts), nis, dof, tuple(reasons), part_nis, off), corrected

    def _sides(
        self, observation: BladeObservation, pose: CameraPose, model: BladeModel
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
                off = [
                    abs(float(m.z[-2] - m.H[-2] @ model.mean))
                    for m in (
                        measure(observation, {side: e}, pose, self.camera, self.frame, model, self.settings)
                        for e in (edges[side], edge)
                    )
                ]
                if off[0] <= off[1]:
                    continue
            edges[side] = edge
        return edges, reasons

    def _edges_settled(self, model: BladeModel, result: UpdateResult) -> BladeModel:
        """Count refused edges: a row of them makes the edge less certain, a long agreeing row makes it forgotten."""
        settings = self.settings
        for side in SIDES:
            if side in result.parts:
                self._refused[side] = []
            if side not in result.refused_m:
                continue
            refused = self._refused[side]
            refused.append(result.refused_m[side])
            recent = refused[-settings.restart_after :]
            if len(recent) == settings.restart_after and np.ptp(recent) < settings.inflation_limit_m:
                self._refused[side] = []
                self._seen_s.pop(side, None)
                model = model.without(side, settings)
            elif len(refused) > settings.patience:
                model = self._less_certain(model, EDGE[side])
        return model


def innovation(model: BladeModel, measurement: Measurement, parts: list[str]) -> tuple[float, int]:
    """Normalised innovation squared of some parts of a measurement, and its degrees of freedom."""
    rows = np.concatenate([np.r_[measurement.parts[part]] for part in parts])
    H = measurement.H[rows]
    innovation = measurement.z[rows] - H @ model.mean
    S = H @ model.covariance @ H.T + measurement.R[np.ix_(rows, rows)]
    return float(innovation @ np.linalg.solve(S, innovation)), len(rows)


def width(measurement: Measurement, model: BladeModel) -> float:
    """From the measured trailing edge to the measured leading one, in metres along `across`."""
    offset = measurement.z - measurement.H[:, PLANE] @ model.mean[PLANE]
    return float(offset[measurement.parts["leading"].start] - offset[measurement.parts["trailing"].start])


def lost(estimate: BladeEstimate | None, max_age_s: float, max_sigma_m: float) -> str | None:
    """Why the blade must be called lost, or None while it may be relied on."""
    if estimate is None:
        return "no blade has been seen"
    if estimate.age_s > max_age_s:
        return f"the blade was last seen {estimate.age_s:.1f} s ago, allowed are {max_age_s:.1f} s"
    if estimate.distance_sigma_m > max_sigma_m:
        return f"the distance is known to ±{estimate.distance_sigma_m:.2f} m, needed are ±{max_sigma_m:.2f} m"
    return None
