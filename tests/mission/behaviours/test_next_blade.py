"""After one blade the next one clockwise is inspected, and nothing of the last is taken for it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flight.autopilot import Setpoint
from mission.behaviours.next_blade import NextBlade, next_blade
from mission.executive.belief import surveyed_turbine
from mission.executive.services import Services
from mission.language.document import load

V80 = Path(__file__).parents[3] / "missions" / "v80_three_blades.yaml"


class Eye(SimpleNamespace):
    """Counts what the perception is told."""

    def watch_blade(self, on: bool) -> None:
        self.watching = on

    def forget(self) -> None:
        self.forgotten += 1


@pytest.fixture
def services() -> Any:
    mission = load(V80)
    here = SimpleNamespace(position=np.array([1.0, 2.0, -70.0]), attitude=np.zeros(3))
    autopilot = SimpleNamespace(telemetry=SimpleNamespace(pose=here))
    turbine = surveyed_turbine(mission)
    log = SimpleNamespace(info=lambda *words, **values: None)
    stream: Any = SimpleNamespace(target=None)
    return Services(
        clock=None, autopilot=autopilot, setpoints=stream, perception=Eye(watching=True, forgotten=0), turbine=turbine,
        mission=mission, raise_event=lambda name, **data: None, log=log,
    )  # type: ignore[arg-type]  # fmt: skip


async def test_each_blade_has_its_turn_and_then_none_is_left(services: Any) -> None:
    surveyed = services.turbine
    azimuths, outcomes = [float(np.degrees(surveyed.azimuth))], []
    for _ in range(3):
        outcomes.append(await next_blade(services, NextBlade(blades=3)))
        azimuths.append(float(np.degrees(services.turbine.azimuth)))
    assert outcomes == ["chosen", "chosen", "none_left"]
    assert azimuths == pytest.approx([45.0, 165.0, 285.0, 285.0])
    assert np.array_equal(services.turbine.hub, surveyed.hub) and services.turbine.heading == surveyed.heading


async def test_what_was_found_of_one_blade_is_not_believed_of_the_next(services: Any) -> None:
    services.memory.passes_done += ["leading", "trailing"]
    services.memory.tip_station_m, services.memory.root_station_m = 39.8, 1.4
    await next_blade(services, NextBlade(blades=2))
    assert services.memory.passes_done == []
    assert services.memory.tip_station_m is None and services.memory.root_station_m is None
    assert services.perception.forgotten == 1 and not services.perception.watching
    assert services.memory.azimuth == pytest.approx(np.radians(165.0))


async def test_the_vehicle_stays_where_it_is_meanwhile(services: Any) -> None:
    await next_blade(services, NextBlade())
    target = services.setpoints.target
    assert isinstance(target, Setpoint) and target.position.tolist() == [1.0, 2.0, -70.0]
