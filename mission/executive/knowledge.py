"""What the eye knows of the blade, kept beside the journal while it flies, so that a run that was cut off need not
begin to look from nothing."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

if TYPE_CHECKING:
    from mission.executive.clock import Clock
    from mission.executive.perception import VisionLoop
    from vision.estimate import BladeFrame

FILE = "knowledge.json"
KEEP_S = 1.0  # mission, and at most once a wall second
STALE_S = 300.0  # mission; by then the vehicle's position has drifted under what was tracked
SAME_FRAME = 1e-3  # metres at the hub, and of unit vectors

Vector = tuple[float, float, float]


class Tracked(BaseModel):
    """The tracker's state (vision.blade_model) around its reference point, and when each part was last seen."""

    model_config = ConfigDict(frozen=True)

    station: float
    offset: float
    mean: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    lens: Vector | None = None
    stamp_s: float
    seen_s: dict[str, float]


class Knowledge(BaseModel):
    """One moment. t: mission seconds; wall_s: of the system's clock. origin … depth: the blade frame in local NED in
    which the rest is expressed. edges: side → bin of half a metre → offset (vision.landmarks.EdgeMap)."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    format: Literal[1] = 1
    t: float
    wall_s: float
    origin: Vector
    span: Vector
    across: Vector
    depth: Vector
    tracked: Tracked | None
    edges: dict[str, dict[int, float]]


def known(perception: VisionLoop, now_s: float) -> Knowledge:
    """What the eye knows now."""
    frame, kept = perception.frame, perception.tracker.kept()
    tracked = None
    if kept is not None:
        tracked = Tracked(
            station=kept.model.station,
            offset=kept.model.offset,
            mean=tuple(kept.model.mean.tolist()),
            covariance=tuple(tuple(row) for row in kept.model.covariance.tolist()),
            lens=None if kept.model.lens is None else _vector(kept.model.lens),
            stamp_s=kept.stamp_s,
            seen_s=dict(kept.seen_s),
        )
    return Knowledge(
        t=now_s,
        wall_s=time.time(),
        origin=_vector(frame.origin),
        span=_vector(frame.span),
        across=_vector(frame.across),
        depth=_vector(frame.depth),
        tracked=tracked,
        edges={side: {int(key): float(value) for key, value in seen.items()} for side, seen in _edges(perception)},
    )


def read_knowledge(folder: Path) -> Knowledge | None:
    """What a run's folder holds; None where it holds nothing, or nothing that can be read."""
    try:
        return Knowledge.model_validate_json((folder / FILE).read_text("utf-8"))
    except (OSError, ValidationError, UnicodeDecodeError):
        return None


def write_knowledge(folder: Path, knowledge: Knowledge, *, sync: bool = True) -> None:
    """Replace the file in one step: whoever reads it finds the old one or the new one, whole.

    Raises:
        OSError: it cannot be written; the old one stays.
    """
    draft = folder / (FILE + ".part")
    with draft.open("w", encoding="utf-8") as file:
        file.write(knowledge.model_dump_json() + "\n")
        file.flush()
        if sync:
            os.fsync(file.fileno())
    draft.replace(folder / FILE)


def go_on_from(perception: VisionLoop, knowledge: Knowledge, now_s: float, speed: float) -> bool:
    """Let the eye go on from what was known; False, and nothing changes, where that is too old or of another frame.

    Time that passed in between is counted by the system's clock, so that what is tracked has aged by it: its age is
    told truly, and its uncertainty has grown as fast as positions drift.
    """
    age_s = max(0.0, time.time() - knowledge.wall_s) * speed
    if age_s > STALE_S or not _same(perception.frame, knowledge):
        return False
    if knowledge.tracked is not None:
        from vision.blade_model import BladeModel
        from vision.blade_motion import SIZE
        from vision.tracker import Kept

        tracked = knowledge.tracked
        if {len(tracked.mean), len(tracked.covariance), *map(len, tracked.covariance)} != {SIZE}:
            return False  # of another version of this program
        later_s = now_s - age_s - knowledge.t
        lens = None if tracked.lens is None else np.array(tracked.lens)
        model = BladeModel(tracked.station, tracked.offset, np.array(tracked.mean), np.array(tracked.covariance), lens)
        seen_s = {part: stamp_s + later_s for part, stamp_s in tracked.seen_s.items()}
        perception.tracker.go_on_from(Kept(model, tracked.stamp_s + later_s, seen_s))
    for side, seen in knowledge.edges.items():
        perception.edge_map.offsets.setdefault(side, {}).update(seen)
    return True


class Keeping:
    """Keeps the file up to date. Whatever keeps it from that is told to `log` once; the flight goes on."""

    def __init__(self, folder: Path, perception: VisionLoop, log: Any, *, threaded: bool) -> None:
        self._folder, self._perception, self._log, self._threaded = folder, perception, log, threaded
        self._last: Knowledge | None = None
        self._refused = False

    async def run(self, clock: Clock) -> None:
        """Until cancelled."""
        while True:
            await clock.sleep(max(KEEP_S, clock.speed * KEEP_S if self._threaded else KEEP_S))
            try:
                await self._keep(clock.now())
            except Exception as error:
                if not self._refused:
                    self._log.error("knowledge not kept", reason=f"{type(error).__name__}: {error}".splitlines()[0])
                self._refused = True

    async def _keep(self, now_s: float) -> None:
        knowledge = known(self._perception, now_s)
        if self._last is not None and _same_but_for_time(knowledge, self._last):
            return
        if self._threaded:
            await asyncio.to_thread(write_knowledge, self._folder, knowledge)
        else:
            write_knowledge(self._folder, knowledge, sync=False)
        self._last, self._refused = knowledge, False


def _same_but_for_time(one: Knowledge, other: Knowledge) -> bool:
    return one.model_copy(update={"t": other.t, "wall_s": other.wall_s}) == other


def _same(frame: BladeFrame, knowledge: Knowledge) -> bool:
    there = (knowledge.origin, knowledge.span, knowledge.across, knowledge.depth)
    here = (frame.origin, frame.span, frame.across, frame.depth)
    return all(bool(np.allclose(a, b, rtol=0, atol=SAME_FRAME)) for a, b in zip(here, there, strict=True))


def _edges(perception: VisionLoop) -> list[tuple[str, Mapping[int, float]]]:
    return [(side, dict(seen)) for side, seen in perception.edge_map.offsets.items()]


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
