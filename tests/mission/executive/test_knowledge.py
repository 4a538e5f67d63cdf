"""What the eye knew of the blade outlives the program that saw it, ages honestly, and is not believed for ever."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mission.executive.knowledge import FILE, STALE_S, go_on_from, known, read_knowledge, write_knowledge
from vision.camera import Camera
from vision.capture import CameraPose
from vision.estimate import BladeFrame
from vision.landmarks import EdgeMap
from vision.observation import BladeObservation, Edge, Line
from vision.tracker import BladeTracker

CAMERA = Camera(612, 512, 616.0, 616.0, 305.5, 255.5)
FRAME = BladeFrame(np.array([60.0, 10.0, -78.0]), -np.eye(3)[2], np.eye(3)[1], np.eye(3)[0])
POSE = CameraPose(FRAME.to_ned(np.array([20.0, 0.0, -3.0])), np.eye(3))


def eye(frame: BladeFrame = FRAME) -> Any:
    return SimpleNamespace(frame=frame, tracker=BladeTracker(frame, CAMERA), edge_map=EdgeMap())


@pytest.fixture
def seen() -> Any:
    """An eye that has watched a blade, three metres away, until mission second 102."""
    found = eye()
    sigma = np.diag([0.02, 0.02, 0.02]) ** 2
    ends = np.array([[120.0, -200.0], [120.0, 200.0]])
    edge = Edge(Line(0.0, 120.0), np.array([1.0, 0.0]), 0.004, 1.2, 1.0, ends)
    for stamp_s in np.arange(100.0, 102.01, 0.2):
        observation = BladeObservation(
            float(stamp_s), True, distance_m=3.0, distance_sigma_m=0.02, nearest_m=3.0, normal=np.array([-1.0, 0, 0]),
            plane_point=np.array([3.0, 0.0, 0.0]), plane_covariance=sigma, edges=(edge,), heading=-np.pi / 2,
        )  # fmt: skip
        found.tracker.update(observation, POSE)
    assert found.tracker.estimate(102.0, POSE) is not None
    found.edge_map.offsets["leading"][40] = 0.6
    return found


def kept(folder: Path, perception: Any, now_s: float) -> Any:
    write_knowledge(folder, known(perception, now_s))
    return read_knowledge(folder)


def test_the_next_program_sees_the_blade_where_the_last_one_did(
    seen: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mission.executive.knowledge.time.time", lambda: 1000.0)
    saved, after = kept(tmp_path, seen, 102.2), eye()
    assert go_on_from(after, saved, 102.2, speed=1.0)
    before, now = seen.tracker.estimate(102.2, POSE), after.tracker.estimate(102.2, POSE)
    np.testing.assert_allclose(now.state, before.state, atol=1e-9)
    np.testing.assert_allclose(now.covariance, before.covariance, atol=1e-12)
    assert now.age_s == pytest.approx(before.age_s) and now.leading.age_s == pytest.approx(before.leading.age_s)
    assert after.edge_map.offsets["leading"] == {40: 0.6}


def test_time_between_two_programs_makes_it_older_and_less_certain(
    seen: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mission.executive.knowledge.time.time", lambda: 1000.0)
    saved, after = kept(tmp_path, seen, 102.0), eye()
    monkeypatch.setattr("mission.executive.knowledge.time.time", lambda: 1010.0)
    assert go_on_from(after, saved, 50.0, speed=4.0)
    now = after.tracker.estimate(50.0, POSE)
    assert now.age_s == pytest.approx(40.0, abs=0.01)
    drifted_m = seen.tracker.settings.drift_m_per_root_s * np.sqrt(40.0)
    assert now.distance_sigma_m == pytest.approx(np.hypot(drifted_m, 0.01), rel=0.15)


@pytest.mark.parametrize("elapsed_s, believed", [(STALE_S - 1, True), (STALE_S + 1, False), (-3600.0, True)])
def test_what_is_minutes_old_is_not_believed(
    seen: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, elapsed_s: float, believed: bool
) -> None:
    monkeypatch.setattr("mission.executive.knowledge.time.time", lambda: 1e6)
    saved, after = kept(tmp_path, seen, 102.0), eye()
    monkeypatch.setattr("mission.executive.knowledge.time.time", lambda: 1e6 + elapsed_s)
    assert go_on_from(after, saved, 102.0, speed=1.0) is believed
    assert (after.tracker.estimate(102.0, POSE) is not None) is believed


def test_knowledge_of_another_frame_is_not_used(seen: Any, tmp_path: Path) -> None:
    moved = eye(replace(FRAME, origin=FRAME.origin + np.array([0.0, 0.05, 0.0])))
    assert not go_on_from(moved, kept(tmp_path, seen, 102.0), 102.0, speed=1.0)
    assert moved.tracker.estimate(102.0, POSE) is None


def test_before_a_blade_was_seen_there_is_nothing_to_go_on_from(tmp_path: Path) -> None:
    saved, after = kept(tmp_path, eye(), 10.0), eye()
    assert saved.tracked is None and go_on_from(after, saved, 10.0, speed=1.0)
    assert after.tracker.estimate(10.0, POSE) is None


def test_a_file_that_is_torn_or_missing_is_no_knowledge(seen: Any, tmp_path: Path) -> None:
    assert read_knowledge(tmp_path) is None
    write_knowledge(tmp_path, known(seen, 102.0))
    whole = (tmp_path / FILE).read_bytes()
    for length in range(0, len(whole) - 2, 97):
        (tmp_path / FILE).write_bytes(whole[:length])
        assert read_knowledge(tmp_path) is None


def test_a_full_disk_leaves_the_last_knowledge(seen: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_knowledge(tmp_path, known(seen, 102.0))

    def full(self: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError):
        write_knowledge(tmp_path, known(seen, 103.0))
    found = read_knowledge(tmp_path)
    assert found is not None and found.t == 102.0
