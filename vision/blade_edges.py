"""Edges that the tracker must let go of: those that another one, seen in a row, contradicts, and those that no blade
has."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vision.blade_gate import BladeGate, Judged
from vision.blade_model import BladeModel
from vision.blade_motion import EDGE, SIDES, SIGN, Side
from vision.capture import CameraPose
from vision.observation import BladeObservation
from vision.tracker_settings import TrackerSettings
from vision.tremble import Tremble


@dataclass(frozen=True)
class Rival:
    """The blade with one edge as its refused observations alone tell. agreeing: how many of them in a row."""

    model: BladeModel
    agreeing: int


class EdgeRivals:
    """Tracks each refused edge beside the blade, so that refused observations are judged by one another, however far
    off the tracked edge has gone."""

    def __init__(self, gate: BladeGate, settings: TrackerSettings) -> None:
        self._gate, self._settings = gate, settings
        self._rivals: dict[Side, Rival] = {}

    def forget(self, side: Side | None = None) -> None:
        """Drop what was refused, of one side or of both."""
        for each in SIDES if side is None else (side,):
            self._rivals.pop(each, None)

    def after(
        self,
        judged: Judged,
        observation: BladeObservation,
        pose: CameraPose,
        tremble: Tremble,
        seconds: float,
    ) -> dict[Side, BladeModel]:
        """Of an observation that was used, `seconds` after the one before: the blade anew for each side on which
        enough refused edges in a row agree with one another."""
        won: dict[Side, BladeModel] = {}
        for side in SIDES:
            rival = self._rivals.pop(side, None)
            refused = side in judged.result.refused_m
            if side in judged.result.parts or (rival is None and not refused):
                continue
            later = None
            if rival is not None:
                later = self._corrected(rival, side, refused, observation, pose, tremble, seconds)
            if later is None and refused:
                fresh = Rival(judged.before.without(side, self._settings), 0)
                later = self._corrected(fresh, side, refused, observation, pose, tremble, 0.0)
            if later is None:
                continue
            if later.agreeing >= self._settings.restart_after:
                won[side] = later.model
            else:
                self._rivals[side] = later
        return won

    def _corrected(
        self,
        rival: Rival,
        side: Side,
        seen: bool,
        observation: BladeObservation,
        pose: CameraPose,
        tremble: Tremble,
        seconds: float,
    ) -> Rival | None:
        """The rival after this observation too, None where it contradicts it."""
        model = rival.model.later(max(seconds, 0.0), tremble.jitter_m, self._settings)
        judged = self._gate.correct(model, observation, pose, tremble, max(-seconds, 0.0))
        if judged.after is None or (seen and side not in judged.result.parts):
            return None
        return Rival(judged.after, rival.agreeing + seen)


def impossible(model: BladeModel, seen: Iterable[str], settings: TrackerSettings) -> list[Side]:
    """Which of the edges that were seen no blade has: they run away from its span, or lie too far from one another or
    the wrong way round; of two edges that contradict each other, the one that is known less well."""
    sides = [side for side in SIDES if side in seen]
    steepest = float(np.interp(model.station, settings.round_within_m, settings.steepest_edge))
    wrong = [side for side in sides if not abs(model.mean[EDGE[side]][1]) <= steepest]
    if len(sides) == 2 and not wrong:
        chord = sum(SIGN[side] * model.mean[EDGE[side].start] for side in sides)
        if not 0 < chord <= settings.largest_chord_m:
            wrong = [max(sides, key=lambda side: float(model.covariance[EDGE[side].start, EDGE[side].start]))]
    return wrong
