"""An unexpected error in vision, or in what runs beside the executive, is told; it ends nothing by itself."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flight.autopilot import VehiclePose
from mission.executive.assembly import _watch
from mission.executive.clock import LockstepClock, LockstepLoop
from mission.executive.perception import VisionLoop
from vision.capture import StereoFrames
from vision.estimate import BladeFrame

PLACES = ("capture", "observe", "pose", "update")


class Log:
    """Keeps what was logged."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def error(self, text: str, **about: Any) -> None:
        self.lines.append(text)


@pytest.fixture
def silent() -> Log:
    return Log()


class Fragile:
    """Rig, eye, autopilot, tracker and record in one; the named one raises for the first three cycles."""

    def __init__(self, breaks: str) -> None:
        self.breaks, self.captured = breaks, 0
        self.gaps: list[str] = []
        self.recorded = 0
        self.geometry = SimpleNamespace(stereo=SimpleNamespace(left=None))
        self.telemetry = SimpleNamespace(pose=VehiclePose(0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2)))

    def _may_break(self, place: str) -> None:
        if place == self.breaks and self.captured <= 3:
            raise ZeroDivisionError(f"in {place}")

    def capture(self, laser: bool) -> StereoFrames:
        self.captured += 1
        self._may_break("capture")
        return StereoFrames(0.0, None, None, None, None)

    def set_laser(self, on: bool) -> None: ...

    def observe(self, frames: StereoFrames, expected: float | None = None) -> Any:
        self._may_break("observe")
        return SimpleNamespace(valid=False)

    def pose_at(self, stamp_s: float) -> VehiclePose:
        self._may_break("pose")
        return self.telemetry.pose

    def update(self, observation: Any, pose: Any) -> Any:
        self._may_break("update")
        return SimpleNamespace(accepted=False)

    def estimate(self, now_s: float, pose: Any) -> None:
        return None

    def gap(self, stamp_s: float, reason: str) -> None:
        self.gaps.append(reason)

    def cycle(self, *about: Any) -> None:
        self.recorded += 1


@pytest.mark.parametrize("breaks", PLACES)
def test_a_cycle_of_vision_that_fails_is_a_gap_and_the_next_one_sees_again(breaks: str, silent: Any) -> None:
    parts: Any = Fragile(breaks)
    frame = BladeFrame(np.zeros(3), *np.eye(3))

    async def story() -> None:
        loop = VisionLoop(
            rig=parts, eye=parts, find_rotor=lambda image: None, tracker=lambda frame: parts, frame=frame,
            autopilot=parts, clock=LockstepClock(), mount=(0.0, 0.0, 0.0), sink=parts, log=silent,
        )  # fmt: skip
        loop.watch_blade(True)
        task = asyncio.create_task(loop.run())
        await asyncio.sleep(3.0)
        assert not task.done()
        task.cancel()

    with asyncio.Runner(loop_factory=LockstepLoop) as runner:
        runner.run(story())
    assert parts.gaps == [f"ZeroDivisionError: in {breaks}"] * 3
    assert parts.recorded >= 5
    assert sum("vision cycle failed" in line for line in silent.lines) == 1


@pytest.mark.parametrize("raises", [True, False])
def test_what_runs_beside_the_executive_does_not_end_unnoticed(raises: bool, silent: Any) -> None:
    events: list[tuple[str, dict[str, Any]]] = []
    executive: Any = SimpleNamespace(raise_event=lambda name, **data: events.append((name, data)))

    async def ends() -> None:
        if raises:
            raise ZeroDivisionError("by surprise")

    async def story() -> None:
        task = asyncio.create_task(ends(), name="telemetry")
        task.add_done_callback(lambda ended: _watch(ended, executive, silent))
        await asyncio.wait([task])
        await asyncio.sleep(0)
        cancelled = asyncio.create_task(asyncio.sleep(9.0), name="vision")
        cancelled.add_done_callback(lambda ended: _watch(ended, executive, silent))  # type: ignore[arg-type]
        cancelled.cancel()
        await asyncio.wait([cancelled])

    asyncio.run(story())
    assert [name for name, _ in events] == ["abort"]
    assert events[0][1]["error"].startswith("telemetry ended")
    assert any("task ended" in line for line in silent.lines)
