"""An executive that only looks as if it flew, for the live view. As a program it shows itself until `a` is pressed."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from mission.cli.live import open_view
from mission.executive.status import Next, Status
from mission.record.folder import RunFolder
from tests.mission.record.synthetic_run import estimate, telemetry, write_journal

STATES = {"inspect.leading": SimpleNamespace(do="follow_edge", parameters=SimpleNamespace(standoff_m=3.0))}
MISSION: Any = SimpleNamespace(
    name="v80_blade", states=STATES, turbine=SimpleNamespace(root_radius_m=1.0, tip_radius_m=40.0)
)


class FakeExecutive:
    """Follows the leading edge for ever. `raised` is what the operator asked for."""

    def __init__(self, folder: RunFolder, now_s: float = 72.0) -> None:
        self.raised: list[str] = []
        self.waiting: str | None = None
        self.now_s = now_s
        self._journal = folder.journal
        self._started = time.monotonic()
        self.services = SimpleNamespace(
            mission=MISSION,
            autopilot=SimpleNamespace(simulated=True, telemetry=telemetry(40.0, -60.0)),
            perception=SimpleNamespace(
                vision_age_s=0.2, side="leading", cycles=100, estimate=lambda: estimate(self.now_s, 23.4, 3.02)
            ),
            clock=SimpleNamespace(now=lambda: self.now_s + time.monotonic() - self._started, speed=4.0),
            progress=SimpleNamespace(text="both edges in view", station_m=23.4),
            memory=SimpleNamespace(home=np.zeros(3)),
        )

    def status(self) -> Status:
        following = (
            Next("tip_detected", "inspect.confirm_tip", None, False),
            Next("battery_low", "abort.back_off", "needs battery_percent < 40 (battery_percent is 81)", False),
        )
        return Status(
            mission="v80_blade", path="inspect.leading", now_s=self.services.clock.now(), entered_s=60.0,
            deadline_s=300.0, behaviour="follow_edge", next=following, recent=(), autonomy="full",
            paused="paused" in self.raised, waiting=self.waiting, let_go=False, interrupted=False, journal_error=None,
            ended=None,
        )  # fmt: skip

    def answers(self, name: str) -> bool:
        return True

    def raise_event(self, name: str, **data: Any) -> None:
        self.raised.append(name)
        self.waiting = None
        with self._journal.open("a") as file:
            file.write(
                json.dumps({"seq": 99, "t": self.now_s, "kind": "operator", "command": name, "who": "me"}) + "\n"
            )


def show(path: Path) -> None:
    folder = RunFolder(path)
    write_journal(folder, until_s=90.0)
    view = open_view(MISSION, folder, headless=False)
    executive: Any = FakeExecutive(folder)
    executive.waiting = "Arm the vehicle?" if "--ask" in sys.argv else None
    view.start(executive)
    answer = view.ask("Arm the vehicle?") if "--ask" in sys.argv else None
    while "abort" not in executive.raised:
        time.sleep(0.05)
    view.close()
    print(f"raised {executive.raised}, answered {answer}")


if __name__ == "__main__":
    show(Path(sys.argv[1]))
