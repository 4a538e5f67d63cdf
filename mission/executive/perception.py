"""The vision loop: capture, observe, track, record; at its own rate, never in the setpoints' way."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import structlog

from devices.rig import CaptureError, Rig
from flight.autopilot import Autopilot, VehiclePose
from vision.capture import CameraPose, StereoFrames, camera_pose
from vision.consistency import Watch
from vision.landmarks import EdgeMap, TipSighting, sight_tip
from vision.observation import BladeObservation, FarView

if TYPE_CHECKING:
    from mission.executive.clock import Clock
    from mission.executive.pace import Pace
    from vision.estimate import BladeEstimate, BladeFrame
    from vision.tracker import BladeTracker, UpdateResult

TIPS_KEPT = 20
POSE_WAIT_S = 0.5  # how long a late telemetry pose is waited for before a frame is given up


class Observer(Protocol):
    """What the loop needs of the vision pipeline."""

    def observe(self, frames: StereoFrames, expected: float | None = None) -> BladeObservation: ...


class CycleSink(Protocol):
    """Where every cycle goes for the record; must not block."""

    def cycle(
        self,
        frames: StereoFrames,
        observation: BladeObservation,
        update: UpdateResult | None,
        estimate: BladeEstimate | None,
        side: str | None,
    ) -> None: ...

    def gap(self, stamp_s: float, reason: str) -> None: ...

    def photograph(self, frames: StereoFrames, subject: str) -> None: ...


@dataclass(frozen=True)
class FarSight:
    """One far view and the pose it was taken from."""

    view: FarView
    pose: CameraPose


class VisionLoop:
    """Implements `Perception` of mission/executive/services.py; `run` is one task of the executive's loop."""

    def __init__(
        self,
        *,
        rig: Rig,
        eye: Observer,
        find_rotor: Callable[[Any], FarView],
        tracker: Callable[[BladeFrame], BladeTracker],
        frame: BladeFrame,
        autopilot: Autopilot,
        clock: Clock,
        mount: tuple[float, float, float],
        sink: CycleSink,
        pace: Pace | None = None,
        log: Any = None,
        rate_hz: float = 5.0,
        latency_s: float = 0.0,
    ) -> None:
        self._rig, self._eye, self._find_rotor = rig, eye, find_rotor
        self._new_tracker = tracker
        self._autopilot, self._clock, self._sink = autopilot, clock, sink
        self._pace = pace
        self._mount = np.array(mount)
        self._period_s = 1.0 / rate_hz
        self._latency_s = latency_s
        self._log = structlog.get_logger() if log is None else log
        self._failure: str | None = None
        self._claims = Watch()
        self._watching = False
        self._side: str | None = None
        self._cycle = asyncio.Condition()
        self._busy = asyncio.Lock()
        self.observation: BladeObservation | None = None
        self.watching_since_s: float | None = None
        self.last_accepted_s: float | None = None
        self.cycles = 0
        self.accepted = 0
        self.use_frame(frame)

    def use_frame(self, frame: BladeFrame) -> None:
        """Start afresh with another idea of where the blade lies, as after the survey."""
        self.frame = frame
        self.tracker = self._new_tracker(frame)
        self._claims.forget()
        self.tips: Sequence[TipSighting] = ()
        self.edge_map = EdgeMap()

    @property
    def watching(self) -> bool:
        return self._watching

    @property
    def side(self) -> str | None:
        """Whose frames are being recorded."""
        return self._side

    @property
    def vision_age_s(self) -> float | None:
        """Since the last accepted observation, or since the watch began; None while nobody watches."""
        if not self._watching or self.watching_since_s is None:
            return None
        return self._clock.now() - max(self.last_accepted_s or 0.0, self.watching_since_s)

    def estimate(self) -> BladeEstimate | None:
        return self.tracker.estimate(self._clock.now(), self.pose_of(self._autopilot.telemetry.pose))

    def pose_of(self, pose: VehiclePose) -> CameraPose:
        """Where the left camera is, by telemetry."""
        return camera_pose(pose.position, pose.attitude, pose.gimbal, self._mount)

    async def next_observation(self) -> BladeObservation:
        async with self._cycle:
            await self._cycle.wait()
        assert self.observation is not None
        return self.observation

    async def far_view(self) -> FarSight:
        """One picture without laser, searched for the rotor; refused with the reason when no picture came."""
        async with self._busy:
            try:
                frames = await self._clock.work(self._rig.capture, False)
            except CaptureError as error:
                return FarSight(FarView(False, (str(error),)), self.pose_of(self._autopilot.telemetry.pose))
            pose = await self._pose_at(frames.stamp_s)
            if pose is None:
                return FarSight(
                    FarView(False, ("no telemetry at the exposure",)), self.pose_of(self._autopilot.telemetry.pose)
                )
            return FarSight(await self._clock.work(self._find_rotor, frames.left), pose)

    async def photograph(self, subject: str) -> bool:
        """One picture without laser, recorded with the pose it was taken from; False when none came."""
        async with self._busy:
            try:
                frames = await self._clock.work(self._rig.capture, False)
            except CaptureError as error:
                self._sink.gap(self._clock.now(), str(error))
                return False
            pose = await self._pose_at(frames.stamp_s)
            self._sink.photograph(StereoFrames(frames.stamp_s, frames.left, frames.right, None, None, pose), subject)
            return True

    def watch_blade(self, on: bool) -> None:
        if on and not self._watching:
            self.watching_since_s = self._clock.now()
        self._watching = on
        self._rig.set_laser(on)

    def chord(self, station_m: float) -> float | None:
        return self.edge_map.chord(station_m)

    def forget(self) -> None:
        self.tracker.forget()
        self._claims.forget()
        self.tips = ()

    def record(self, side: str | None) -> None:
        self._side = side

    async def run(self) -> None:
        """Cycle for ever; cancelled at the end of the run. A cycle that fails is a gap, never the end."""
        due = self._clock.now()
        while True:
            now = self._clock.now()
            due = max(due + self._period_s, now)
            if self._watching:
                async with self._busy:
                    if self._pace is not None:
                        self._pace.begin()
                    try:
                        await self._one_cycle()
                    except Exception as error:
                        self._failed(error)
                    else:
                        self._failure = None
                    if self._pace is not None:
                        self._pace.end()
            await self._clock.sleep(max(due - self._clock.now(), 0.002))

    def _failed(self, error: Exception) -> None:
        """What goes on failing in the same way is told to the log once, and to the record each time."""
        reason = f"{type(error).__name__}: {error}".splitlines()[0][:200]
        if reason != self._failure:
            self._failure = reason
            self._log.error("vision cycle failed", error=reason, exc_info=error)
        with suppress(Exception):  # the record itself may be what fails
            self._sink.gap(self._clock.now(), reason)

    async def _one_cycle(self) -> None:
        side = self._side
        try:
            frames = await self._clock.work(self._rig.capture, True)
        except CaptureError as error:
            self._sink.gap(self._clock.now(), str(error))
            return
        observation = await self._clock.work(self._eye.observe, frames, self._expected_axis())
        if self._latency_s:
            await self._clock.sleep(self._latency_s)
        pose = await self._pose_at(frames.stamp_s)
        if pose is None:
            self._sink.gap(frames.stamp_s, "no telemetry at the exposure")
            return
        if not self._watching:
            return
        frames = StereoFrames(frames.stamp_s, frames.left, frames.right, frames.left_laser, frames.right_laser, pose)
        update = self.tracker.update(observation, pose)
        estimate = self.tracker.estimate(frames.stamp_s, pose)
        self.cycles += 1
        self._hold_to_claims(update)
        if update.accepted and estimate is not None:
            self.accepted += 1
            self.last_accepted_s = frames.stamp_s
            self.edge_map.add(estimate)
            sighting = sight_tip(observation, estimate, pose, self.frame, self._rig.geometry.stereo.left)
            if sighting is not None:
                self.tips = (*self.tips[-TIPS_KEPT + 1 :], sighting)
        self._sink.cycle(frames, observation, update, estimate, side)
        self.observation = observation
        async with self._cycle:
            self._cycle.notify_all()

    def _hold_to_claims(self, update: UpdateResult) -> None:
        """Tell the log when the blade has been seen elsewhere than predicted for seconds, more than sigmas allow."""
        if not update.accepted or not self._claims.add(update.nis, update.dof):
            return
        if self._claims.excess is not None:
            self._log.warning("tracker inconsistent", nis_per_dof=round(self._claims.excess, 2))
        else:
            self._log.info("tracker consistent again")

    def _expected_axis(self) -> float:
        """Direction of the blade's axis in the image, as survey and gimbal have it now: good to a few degrees."""
        span = self.frame.span @ self.pose_of(self._autopilot.telemetry.pose).rotation
        return float(np.arctan2(span[2], span[1]))

    async def _pose_at(self, stamp_s: float) -> CameraPose | None:
        """The telemetry pose at an exposure; telemetry may still be on its way, so it is waited for a little."""
        for _ in range(10):
            pose = self._autopilot.pose_at(stamp_s)
            if pose is not None:
                return self.pose_of(pose)
            await self._clock.sleep(POSE_WAIT_S / 10)
        return None
