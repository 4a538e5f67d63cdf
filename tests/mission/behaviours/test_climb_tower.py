"""The tower is climbed at the distance that the range finder measures, with a photograph every so often."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mission.behaviours.climb_tower import ClimbTower, climb_tower
from mission.executive.belief import surveyed_turbine
from mission.executive.services import Services
from mission.language.document import load

TOWER = Path(__file__).parents[3] / "missions" / "tower_climb.yaml"
PERIOD_S = 0.05


@dataclass
class Flight:
    """A vehicle that is always at its target; its range finder looks at a tower that stands elsewhere than surveyed."""

    tower_is_off_m: float | None
    services: Any = None
    now_s: float = 0.0
    photographs: list[np.ndarray] = field(default_factory=list)

    def now(self) -> float:
        return self.now_s

    async def sleep(self, seconds: float) -> None:
        self.now_s += seconds

    speed = 1.0

    @property
    def telemetry(self) -> Any:
        target = self.services.setpoints.target
        position = np.zeros(3) if target is None else target.position
        yaw = 0.0 if target is None else target.yaw
        pose = SimpleNamespace(
            position=position, attitude=np.array([0.0, 0.0, yaw]), velocity=np.zeros(3), gimbal=np.zeros(2)
        )
        return SimpleNamespace(pose=pose, range_m=self.range_m(position), range_age_s=0.1, in_air=True)

    def range_m(self, position: np.ndarray) -> float | None:
        if self.tower_is_off_m is None:
            return None
        turbine = self.services.turbine
        ahead = turbine.axes()[0]
        surface = (turbine.hub + turbine.overhang_m * ahead - position) @ ahead - turbine.tower_base_diameter_m / 2
        return float(surface + self.tower_is_off_m)

    def point_gimbal(self, yaw: float, pitch: float) -> None:
        self.gimbal = (yaw, pitch)

    def watch_blade(self, on: bool) -> None:
        assert not on  # no laser

    async def photograph(self, subject: str) -> bool:
        assert subject == "tower"
        self.photographs.append(self.telemetry.pose.position.copy())
        return True


def flight(tower_is_off_m: float | None) -> Flight:
    mission = load(TOWER)
    made = Flight(tower_is_off_m)
    log = SimpleNamespace(info=lambda *words, **values: None)
    stream: Any = SimpleNamespace(target=None, streaming=True)
    made.services = Services(
        clock=made, autopilot=made, setpoints=stream, perception=made, turbine=surveyed_turbine(mission),
        mission=mission, raise_event=lambda name, **data: None, log=log,
    )  # type: ignore[arg-type]  # fmt: skip
    return made


@pytest.mark.parametrize("off_m", [-2.0, 0.0, 2.0])
async def test_the_distance_is_held_however_wrong_the_survey_is(off_m: float) -> None:
    made = flight(off_m)
    outcome = await climb_tower(made.services, ClimbTower(distance_m=9.0, bottom_m=8, top_m=28))
    assert outcome == "done"
    ranges = [made.range_m(position) for position in made.photographs]
    assert ranges[-5:] == pytest.approx([9.0] * 5, abs=0.1)
    assert min(r for r in ranges if r is not None) > 6.5


async def test_the_whole_height_is_photographed_at_the_spacing() -> None:
    made = flight(0.0)
    await climb_tower(made.services, ClimbTower(bottom_m=8, top_m=28, spacing_m=2.0))
    heights = [-position[2] for position in made.photographs]
    assert heights[0] == pytest.approx(8, abs=0.2) and heights[-1] > 26
    assert np.diff(heights).min() >= 2.0 - 1e-9 and np.diff(heights).max() < 2.2


async def test_a_tower_that_is_not_there_is_reported() -> None:
    made = flight(None)
    assert await climb_tower(made.services, ClimbTower(top_m=12)) == "not_found"
