"""Everything that a flight writes down while it lasts, behind one object."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mission.record.folder import RunFolder
from mission.record.frames import FrameRecorder
from mission.record.telemetry import SetpointRecorder, TelemetryRecorder
from mission.record.vision import VisionRecorder

if TYPE_CHECKING:
    from flight.autopilot import Autopilot
    from flight.setpoints import Sent
    from mission.executive.clock import Clock
    from mission.executive.services import SetpointStream
    from vision.camera import Camera
    from vision.capture import StereoFrames
    from vision.estimate import BladeEstimate
    from vision.observation import BladeObservation
    from vision.tracker import UpdateResult


class RunRecorder:
    """Records cycles of vision (a `CycleSink`), telemetry, setpoints and photographs into a run's folder.

    Nothing here raises or waits once it exists: what cannot be written is counted, and told once to `log`.
    """

    def __init__(self, folder: RunFolder, camera: Camera, log: Any, *, inline: bool = False) -> None:
        """Create the files. `inline` (lockstep time) writes photographs at once instead of in a thread of its own.

        Raises:
            OSError: they cannot be created.
        """
        self._log = log
        self.telemetry = TelemetryRecorder(folder.telemetry / "telemetry.csv", self._on_lost)
        self.setpoints = SetpointRecorder(folder.telemetry / "setpoints.csv", self._on_lost)
        self.vision = VisionRecorder(folder.telemetry / "vision.jsonl", self._on_lost)
        self.frames = FrameRecorder(folder.frames, camera, inline=inline, on_lost=self._on_lost)

    def cycle(
        self,
        frames: StereoFrames,
        observation: BladeObservation,
        update: UpdateResult | None,
        estimate: BladeEstimate | None,
        side: str | None,
    ) -> None:
        """One cycle of vision; with a side, its photographs too."""
        self.vision.record(frames.stamp_s, observation, update, estimate, side)
        if side is not None:
            accepted = update is not None and update.accepted
            self.frames.record(frames, side, estimate, accepted, observation.sharpness)

    def photograph(self, frames: StereoFrames, subject: str) -> None:
        """A picture of something else than a blade's edge: it counts for no coverage."""
        self.frames.record(frames, subject, None, accepted=False, sharpness=0.0)

    def gap(self, stamp_s: float, reason: str) -> None:
        """A cycle without images."""
        self.vision.gap(stamp_s, reason)

    def sent(self, sent: Sent) -> None:
        """A setpoint that left."""
        self.setpoints.record(sent.wall_s, sent.t, sent.bounded, sent.first)

    async def follow(
        self, clock: Clock, autopilot: Autopilot, setpoints: SetpointStream | None = None, rate_hz: float = 10.0
    ) -> None:
        """Record telemetry for ever; one task of the executive's loop, cancelled at the end of the run."""
        while True:
            target = setpoints.target if setpoints is not None else None
            self.telemetry.record(clock.now(), autopilot.telemetry, target)
            await clock.sleep(1.0 / rate_hz)

    def close(self) -> None:
        """Write what waits and close every file; idempotent."""
        self.frames.close()
        self.telemetry.close()
        self.setpoints.close()
        self.vision.close()
        if self.frames.dropped or self.frames.lost:
            self._log.warning("frames_missing", dropped=self.frames.dropped, lost=self.frames.lost)

    def _on_lost(self, what: str) -> None:
        self._log.error("record_incomplete", what=what)
