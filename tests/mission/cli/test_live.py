"""The live view: what a scene looks like, what keys do, and how plain lines read where there is no terminal."""

from __future__ import annotations

import json
import os
import pty
import select
import subprocess
import sys
import termios
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from mission.cli.live import PlainView, where
from mission.cli.panel import draw
from mission.cli.scene import Next, Scene, VisionRate, take_scene
from mission.record.folder import RunFolder
from mission.record.follower import JournalFollower, told
from tests.mission.cli.fake_executive import MISSION, FakeExecutive
from tests.mission.cli.program import ROOT
from tests.mission.record.synthetic_run import write_journal

SCENE = Scene(
    mission="v80_blade", state="inspect.leading", now_s=102.0, entered_s=60.0, deadline_s=300.0, speed=4.0,
    behaviour="follow_edge", doing="both edges in view", station_m=23.4, root_m=1.0, tip_m=40.0,
    distance_m=3.02, sigma_m=0.03, target_m=3.0, nearest_m=2.91, vision_age_s=0.2, vision_hz=4.9,
    battery_percent=81.0, wind_m_s=4.2, wind_from_deg=200.0, mode="OFFBOARD", height_m=61.0, link_age_s=0.1,
    recording="leading", events=((60.0, "found → inspect.leading"),),
    following=(Next("tip_detected", "inspect.confirm_tip"), Next("paused", "holding", "needs battery_percent > 40")),
)  # fmt: skip


def drawn(scene: Scene, width: int = 100, question: str | None = None) -> str:
    console = Console(width=width, record=True, file=open(os.devnull, "w"))  # noqa: SIM115, PTH123
    console.print(draw(scene, question))
    return console.export_text()


@pytest.mark.parametrize("width", [76, 80, 140])
def test_a_glance_answers_what_an_operator_asks(width: int) -> None:
    text = drawn(SCENE, width)
    for words in (
        "inspect › leading",
        "42 of 240 s",
        "23.4 of 40.0 m",
        "3.02 ± 0.03 m",
        "0.2 s ago",
        "4.9 a second",
        "OFFBOARD",
        "battery 81 %",
        "wind 4.2 m/s",
        "tip_detected → inspect.confirm_tip",
        "needs battery_percent > 40",
        "found → inspect.leading",
    ):
        assert words in text, text
    assert max(len(line) for line in text.splitlines()) <= width


def test_the_marker_moves_from_root_to_tip_with_the_metres() -> None:
    def column(station_m: float) -> int:
        line = next(
            line for line in drawn(replace(SCENE, station_m=station_m)).splitlines() if "●" in line and "├" in line
        )
        return line.index("●", line.index("├"))

    columns = [column(station_m) for station_m in (1.0, 10.0, 20.0, 30.0, 40.0)]
    assert columns == sorted(set(columns))
    assert column(-5.0) == columns[0]
    assert column(55.0) == columns[-1]


def test_a_scene_of_which_nothing_is_known_yet_is_drawn_all_the_same() -> None:
    text = drawn(Scene(mission="m", state="preflight", now_s=0.0))
    for words in ("no deadline", "not at the blade", "nothing measured", "not watching"):
        assert words in text
    assert where(Scene(mission="m", state="preflight", now_s=0.0, battery_percent=float("nan"))) == "preflight"


def test_a_question_stands_out() -> None:
    assert "Arm the vehicle?" in drawn(SCENE, question="Arm the vehicle?")


def test_a_scene_is_read_from_the_executive_alone(tmp_path: Path) -> None:
    executive: Any = FakeExecutive(RunFolder(tmp_path))
    scene = take_scene(executive, VisionRate())
    assert (scene.state, scene.station_m, scene.distance_m, scene.target_m) == ("inspect.leading", 23.4, 3.02, 3.0)
    assert (scene.height_m, scene.speed, scene.recording) == (60.0, 4.0, "leading")
    assert scene.following[1].blocked_by.startswith("needs battery_percent")


def test_the_rate_of_vision_is_counted_over_the_last_seconds() -> None:
    rate = VisionRate()
    assert rate.update(0.0, 0) is None
    values = [rate.update(second / 4, second * 5 // 4) for second in range(1, 81)]
    assert values[-1] == pytest.approx(5.0, abs=0.3)


def test_the_journal_is_followed_line_by_line_and_half_lines_wait(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    follower = JournalFollower(path)
    assert list(follower.news()) == []
    line = json.dumps({"seq": 0, "t": 1.5, "kind": "transition", "event": "done", "to": "inspect.survey"})
    path.write_text(line[:20])
    assert list(follower.news()) == []
    path.write_text(line + "\n" + json.dumps({"seq": 1, "t": 2.0, "kind": "memory"}) + "\nnonsense\n")
    assert list(follower.news()) == [(1.5, "done → inspect.survey")]
    assert list(follower.news()) == []


def test_news_that_changed_nothing_is_left_out_and_an_unanswered_danger_is_not() -> None:
    def line(event: str, led_to: str) -> dict[str, Any]:
        return {"seq": 0, "t": 0.0, "kind": "event", "event": event, "led_to": led_to, "state": "x"}

    assert told(line("keep_out_bounded", "ignored")) == ""
    assert told(line("wind_high", "ignored")) == "wind_high: ignored"
    assert told(line("tip_detected", "asked")) == "tip_detected: asked"


def test_without_a_terminal_every_transition_is_a_plain_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = RunFolder(tmp_path)
    view = PlainView(MISSION, folder)
    executive: Any = FakeExecutive(folder)
    view.start(executive)
    write_journal(folder)
    view.close()
    view.close()
    out = capsys.readouterr().out
    assert "    60.0  found → inspect.leading\n" in out
    assert "   200.0  completed in completed\n" in out
    assert out.isascii() or "→" in out
    assert "\x1b" not in out


def test_without_a_terminal_the_answer_is_no(tmp_path: Path) -> None:
    assert not PlainView(MISSION, RunFolder(tmp_path)).ask("Arm the vehicle?")


class Terminal:
    """The fake flight in a terminal of its own."""

    def __init__(self, *arguments: object) -> None:
        self._master, self._slave = pty.openpty()
        self.before = termios.tcgetattr(self._slave)
        self.text = ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.mission.cli.fake_executive", *map(str, arguments)],
            cwd=ROOT, stdin=self._slave, stdout=self._slave, stderr=self._slave,
            env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "110", "LINES": "40"},
        )  # fmt: skip

    def wait_for(self, words: str) -> None:
        until = time.monotonic() + 60
        while words not in self.text:
            assert time.monotonic() < until, self.text[-3000:]
            if select.select([self._master], [], [], 0.1)[0]:
                self.text += os.read(self._master, 65536).decode(errors="replace")

    def press(self, keys: str) -> None:
        self.text = ""
        os.write(self._master, keys.encode())

    def settings(self) -> Any:
        return termios.tcgetattr(self._slave)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._master)
        os.close(self._slave)


def test_keys_reach_the_executive_and_the_terminal_is_as_before_afterwards(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path)
    try:
        terminal.wait_for("leading")
        terminal.press("p")
        terminal.wait_for("pausing: the vehicle holds its position")
        terminal.press("xa")
        terminal.wait_for("raised ['paused', 'abort']")
        assert terminal.process.wait(20) == 0
        assert terminal.settings() == terminal.before
    finally:
        terminal.close()


def test_a_question_is_answered_by_a_key(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path, "--ask")
    try:
        terminal.wait_for("Arm the vehicle?")
        terminal.press("y")
        terminal.wait_for("wanted")
        terminal.press("a")
        terminal.wait_for("raised ['abort'], answered True")
    finally:
        terminal.close()


def test_an_abort_waits_for_no_answer(tmp_path: Path) -> None:
    terminal = Terminal(tmp_path, "--ask")
    try:
        terminal.wait_for("Arm the vehicle?")
        terminal.press("a")
        terminal.wait_for("raised ['abort'], answered False")
    finally:
        terminal.close()
