"""The blade tracker: a Kalman filter that keeps the blade in a frame standing still, gates what vision reports, and
predicts it for now from any pose (chapter 6)."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vision.blade_edges import EdgeRivals, impossible
from vision.blade_gate import BladeGate, Judged, UpdateResult
from vision.blade_measurement import look_at
from vision.blade_model import BladeModel, prior
from vision.blade_motion import PLANE, Side
from vision.blade_view import view
from vision.camera import Camera
from vision.capture import CameraPose
from vision.estimate import BladeEstimate, BladeFrame
from vision.observation import BladeObservation, Edge
from vision.tracker_settings import TrackerSettings
from vision.tremble import Tremble

__all__ = ["BladeTracker", "Kept", "TrackerSettings", "UpdateResult", "lost"]

Array = NDArray[np.float64]


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
        self._gate = BladeGate(camera, frame, self.settings)
        self._rivals = EdgeRivals(self._gate, self.settings)
        self.forget()

    def forget(self) -> None:
        """Drop everything that was seen; the survey's frame remains."""
        self._model: BladeModel | None = None
        self._challenger: BladeModel | None = None
        self._challenges = 0
        self._challenged_s = -np.inf
        self._tremble = Tremble.claimed(self.settings)
        self._stamp_s = -np.inf
        self._lasting_m = 0.0
        self._late_s: list[float] = []
        self._taken_s: deque[float] = deque(maxlen=32)
        self._seen_s: dict[str, float] = {}
        self._challenger_seen_s: dict[str, float] = {}
        self._rivals.forget()

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
        self._rivals.forget(side)
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
        model = self._until(self._model, stamp_s).seen_from(self.frame.to_blade(pose.position))
        station, offset, _ = look_at(pose, self.frame, model)
        return model.moved(station, offset, self.settings)

    def estimate(self, stamp_s: float, pose: CameraPose) -> BladeEstimate | None:
        """The blade predicted to `stamp_s` and seen from `pose`; None until observations have confirmed one another."""
        model = self.predict(stamp_s, pose)
        if model is None:
            return None
        seen_s = {p: s for p, s in self._seen_s.items() if p not in impossible(model, self._seen_s, self.settings)}
        ages = {part: max(stamp_s - seen, 0.0) for part, seen in seen_s.items()}
        return view(model, self.frame, pose, self.camera, stamp_s, ages, self._lasting_m, self.settings)

    def update(self, observation: BladeObservation, pose: CameraPose) -> UpdateResult:
        """Use an observation taken from `pose` at its own stamp (6.3 to 6.7), also when a later one came first.

        The surface must pass its χ² gate before the edges, each given the surface, face theirs. A refused surface feeds
        a challenger; only a challenger that was confirmed often enough replaces what is tracked.
        """
        stamp_s = observation.stamp_s
        if not observation.valid or observation.distance_m is None:
            return UpdateResult(False, reasons=observation.reasons or ("vision gave no reason",))
        if not _finite(observation, pose):
            return UpdateResult(False, reasons=("the observation or its pose holds what is no number",))
        observation = replace(observation, edges=tuple(edge for edge in observation.edges if _definite(edge)))
        if stamp_s in self._taken_s:
            return UpdateResult(False, reasons=("the observation was already used",))
        if stamp_s < self._stamp_s - self.settings.history_s:
            return self._late(stamp_s)
        self._late_s = []
        self._taken_s.append(stamp_s)
        if self._model is None:
            return self._challenge(observation, pose, ("the blade is not confirmed yet",))
        seconds = stamp_s - self._stamp_s
        model = self._until(self._model, stamp_s)
        judged = self._gate.correct(model, observation, pose, self._tremble, max(-seconds, 0.0))
        self._stamp_s = max(self._stamp_s, stamp_s)
        if judged.after is None or judged.used is None:
            self._model = model
            return self._challenge(observation, pose, judged.result.reasons)
        self._tremble = self._tremble.learnt(judged.before, judged.used, seconds, self.settings)
        lasting = np.sqrt(max(1 - self._tremble.surface**2, 0.0))
        self._lasting_m = float(lasting * (observation.distance_sigma_m or 0.0))
        self._model = judged.after
        self._challenger, self._challenges = None, 0
        for part in judged.result.parts:
            self._seen_s[part] = max(stamp_s, self._seen_s.get(part, -np.inf))
        return self._edges_settled(judged, observation, pose, seconds)

    def _until(self, model: BladeModel, stamp_s: float) -> BladeModel:
        seconds = stamp_s - self._stamp_s
        return model.later(seconds, self._tremble.jitter_m, self.settings) if 0 < seconds < np.inf else model

    def _late(self, stamp_s: float) -> UpdateResult:
        """Of a row of late observations, each later than the one before, the clock must have been set back."""
        behind_s = self._stamp_s - stamp_s
        self._late_s = [late_s for late_s in self._late_s if late_s < stamp_s] + [stamp_s]
        if len(self._late_s) < self.settings.restart_after:
            return UpdateResult(False, reasons=(f"the observation is {behind_s:.1f} s late",))
        self.forget()
        return UpdateResult(False, reasons=(f"time has gone back by {behind_s:.1f} s: the blade is forgotten",))

    def _challenge(self, observation: BladeObservation, pose: CameraPose, reasons: tuple[str, ...]) -> UpdateResult:
        """A refused observation stands against what is tracked: the covariance grows, and a row of agreeing ones
        wins."""
        settings = self.settings
        judged, tremble = None, self._tremble
        if self._challenger is not None:
            seconds = max(observation.stamp_s - self._challenged_s, 0.0)
            later = self._challenger.later(seconds, tremble.jitter_m, settings)
            judged = self._gate.correct(later, observation, pose, tremble)
        if judged is None or judged.after is None:
            self._challenges = 0
            self._challenger_seen_s = {}
            there, lens = self._gate.meets(observation, pose), self.frame.to_blade(pose.position)
            fresh = prior(there[0], there[1], lens, tremble.jitter_m, settings)
            judged = self._gate.correct(fresh, observation, pose, tremble)
            if judged.after is None:
                self._challenger = None
                return UpdateResult(False, reasons=(*reasons, "nor is it where the survey allows a blade"))
        result, corrected = judged.result, judged.after
        self._challenger, self._challenged_s = corrected, observation.stamp_s
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

    def _edges_settled(
        self, judged: Judged, observation: BladeObservation, pose: CameraPose, seconds: float
    ) -> UpdateResult:
        """Begin an edge anew that refused observations agree to see elsewhere, and forget one that no blade has."""
        reasons = list(judged.result.reasons)
        for side, model in self._rivals.after(judged, observation, pose, self._tremble, seconds).items():
            self._model = model
            self._seen_s[side] = max(observation.stamp_s, self._seen_s.get(side, -np.inf))
            reasons.append(f"started the {side} edge again from {self.settings.restart_after} agreeing observations")
        assert self._model is not None
        for side in impossible(self._model, self._seen_s, self.settings):
            self.forget_side(side)
            reasons.append(f"the {side} edge is forgotten: no blade has it there")
        return replace(judged.result, reasons=tuple(reasons))


def _finite(observation: BladeObservation, pose: CameraPose) -> bool:
    numbers = [np.array([observation.stamp_s, observation.distance_m], float), pose.position, pose.rotation]
    numbers += [each for each in (observation.normal, observation.plane_covariance) if each is not None]
    return all(np.isfinite(each).all() for each in numbers)


def _definite(edge: Edge) -> bool:
    numbers = [edge.line.theta, edge.line.rho, edge.sigma_theta, edge.sigma_rho_px]
    return all(np.isfinite(each).all() for each in (np.array(numbers), edge.outward, edge.ends))


def lost(estimate: BladeEstimate | None, max_age_s: float, max_sigma_m: float) -> str | None:
    """Why the blade must be called lost, or None while it may be relied on."""
    if estimate is None:
        return "no blade has been seen"
    if estimate.age_s > max_age_s:
        return f"the blade was last seen {estimate.age_s:.1f} s ago, allowed are {max_age_s:.1f} s"
    if estimate.distance_sigma_m > max_sigma_m:
        return f"the distance is known to ±{estimate.distance_sigma_m:.2f} m, needed are ±{max_sigma_m:.2f} m"
    return None
