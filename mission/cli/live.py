"""What a person sees of a flight while it lasts: a live panel in a terminal, plain lines everywhere else."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Protocol

from mission.cli.keyboard import keys_pressed, prompt
from mission.cli.scene import Scene, VisionRate, take_scene
from mission.record.follower import JournalFollower

if TYPE_CHECKING:
    from mission.executive.executive import Executive
    from mission.language.document import Mission
    from mission.record.folder import RunFolder

REFRESH_S = 0.25
QUIET_S = 10.0
"""Without news a plain view says every so often that the flight goes on."""

KEYS = {"p": "pause", "r": "resume", "s": "step", "a": "abort"}
SAID_S = 6.0
"""How long the answer to a key stays on the screen."""


class View(Protocol):
    """A view of one flight. `start` is called on the executive's loop and returns at once."""

    def start(self, executive: Executive) -> None:
        """Begin to show this executive."""
        ...

    def ask(self, question: str) -> bool:
        """Ask the operator; blocks the calling thread until there is an answer. No terminal means no."""
        ...

    def close(self) -> None:
        """Stop and give the terminal back; idempotent."""
        ...


def open_view(mission: Mission, folder: RunFolder, *, headless: bool) -> View:
    """The view for where this program runs."""
    return PlainView(mission, folder) if headless else LiveView(mission, folder)


class _Watcher:
    """A thread that looks at the executive a few times a second until told to stop."""

    def __init__(self, mission: Mission, folder: RunFolder) -> None:
        self._mission, self._folder = mission, folder
        self._journal = JournalFollower(folder.journal)
        self._rate = VisionRate()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, executive: Executive) -> None:
        self._thread = threading.Thread(target=self._watch, args=(executive,), name="view", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(2.0)
            self._thread = None

    def _watch(self, executive: Executive) -> None:
        raise NotImplementedError

    def _scene(self, executive: Executive) -> Scene | None:
        """The present scene; None while the flight is being put together or taken apart."""
        try:
            return take_scene(executive, self._rate)
        except Exception:
            return None


class PlainView(_Watcher):
    """Timestamped lines: each transition as the journal has it, and where the flight is every ten seconds."""

    def start(self, executive: Executive) -> None:
        print(f"{self._mission.name}: record in {self._folder.path}", flush=True)
        super().start(executive)

    def ask(self, question: str) -> bool:
        return prompt(question) if sys.stdin.isatty() and sys.stdout.isatty() else False

    def close(self) -> None:
        super().close()
        self._print_news()

    def _watch(self, executive: Executive) -> None:
        said = time.monotonic()
        while not self._stop.wait(REFRESH_S):
            if self._print_news():
                said = time.monotonic()
            elif time.monotonic() - said >= QUIET_S:
                said = time.monotonic()
                scene = self._scene(executive)
                if scene is not None:
                    print(f"{scene.now_s:8.1f}  {where(scene)}", flush=True)

    def _print_news(self) -> bool:
        lines = list(self._journal.news())
        for at, text in lines:
            print(f"{at:8.1f}  {text}", flush=True)
        return bool(lines)


def where(scene: Scene) -> str:
    """A scene in one line."""
    parts = [scene.state]
    if scene.doing:
        parts.append(scene.doing)
    if scene.station_m is not None:
        parts.append(f"{scene.station_m:.1f} m of {scene.tip_m:.1f} m")
    if scene.distance_m is not None:
        parts.append(f"{scene.distance_m:.2f} ± {scene.sigma_m or 0.0:.2f} m away")
    if scene.vision_age_s is not None:
        parts.append(f"seen {scene.vision_age_s:.1f} s ago")
    if scene.battery_percent is not None and scene.battery_percent == scene.battery_percent:
        parts.append(f"battery {scene.battery_percent:.0f} %")
    return " · ".join(parts)


class LiveView(_Watcher):
    """A panel redrawn four times a second, and keys for the operator."""

    def __init__(self, mission: Mission, folder: RunFolder) -> None:
        super().__init__(mission, folder)
        self._events: list[tuple[float, str]] = []
        self._question: str | None = None
        self._answer: Callable[[bool], None] = lambda yes: None
        self._asking = threading.Lock()
        self._said = (-SAID_S, "")
        self._loop: asyncio.AbstractEventLoop | None = None

    def start(self, executive: Executive) -> None:
        with contextlib.suppress(RuntimeError):
            self._loop = asyncio.get_running_loop()
        super().start(executive)

    def ask(self, question: str) -> bool:
        if self._thread is None:
            return prompt(question)
        with self._asking:
            answered = threading.Event()
            answers: list[bool] = []

            def answer(yes: bool) -> None:
                answers.append(yes)
                answered.set()

            self._answer, self._question = answer, question
            while not answered.wait(0.1):
                if self._stop.is_set():
                    return False
            return answers[0]

    def _watch(self, executive: Executive) -> None:
        from rich.console import Console
        from rich.live import Live

        from mission.cli.panel import draw

        console = Console()
        with keys_pressed() as pressed, Live(console=console, auto_refresh=False, transient=True) as live:
            while not self._stop.is_set():
                self._events = [*self._events, *self._journal.news()][-8:]
                question, scene = self._question, self._scene(executive)
                if scene is not None:
                    if question is not None and scene.question is None:
                        self._settle(False)  # something else happened: nobody waits for this answer any more
                    scene = replace(scene, events=tuple(self._events))
                    said = self._said[1] if time.monotonic() - self._said[0] < SAID_S else ""
                    live.update(draw(scene, self._question, said, str(self._folder.path)), refresh=True)
                for key in pressed(REFRESH_S):
                    self._press(executive, key)

    def _press(self, executive: Executive, key: str) -> None:
        if self._question is not None and key in "yYnN":
            self._settle(key in "yY")
            return
        command = KEYS.get(key.lower())
        if command is None:
            return
        if self._loop is None:
            self._obey(executive, command)
        else:
            self._loop.call_soon_threadsafe(self._obey, executive, command)

    def _obey(self, executive: Executive, command: str) -> None:
        """On the executive's loop, as a command from another shell would be followed."""
        from mission.executive.operator import at_the_keyboard, obey

        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        self._said = (time.monotonic(), obey(executive, {"command": command}, at_the_keyboard(), at).text)

    def _settle(self, yes: bool) -> None:
        self._question = None
        self._answer(yes)
