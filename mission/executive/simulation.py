"""The simulated side of a flight: the true world, the vehicle in it, and the rehearsal of faults."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from devices.world.world import World
    from mission.executive.clock import Clock
    from mission.language.document import Mission


def build_world(mission: Mission) -> World:
    """The true world of a mission: its files, with the survey's error and the seed of its `world` section."""
    from devices.world.settings import WorldSettings
    from devices.world.turbine import TurbineShape
    from devices.world.world import World

    settings = mission.world or WorldSettings()
    shape = TurbineShape.of(mission.turbine.model_dump(), mission.site.model_dump(), settings.survey_error)
    return World(shape, settings)


Switch = Callable[..., object]
"""A fault switch of the simulated vehicle: `switch(name, **arguments)`, see devices.vehicle.fault_switches."""

VEHICLE_FAULTS = ("range_finder", "gps_jump", "battery", "link", "gimbal_stuck", "gust")
PERIOD_S = 0.05


def throw(switch: Switch, name: str, on: bool, fault: Any) -> None:
    """Begin or end one of `world.faults` on the vehicle; `fault` holds its values."""
    if name == "range_finder":
        switch("range_finder", working=not on)
    elif name == "link":
        switch("link", up=not on)
    elif name == "gimbal_stuck":
        switch("gimbal", stuck=on)
    elif name == "battery" and on:
        switch("battery", percent=fault.percent)
    elif name == "gust":
        switch("gust", speed_m_s=fault.speed_m_s if on else 0.0, from_deg=fault.from_deg)
    elif name == "gps_jump":
        sign = 1.0 if on else -1.0
        switch("gps_jump", north_m=sign * fault.north_m, east_m=sign * fault.east_m, down_m=sign * fault.down_m)


@dataclass
class Rehearsal:
    """Puts the faults of the world into effect at their times: some on the vehicle, one on this program itself.

    switch: None where the vehicle is no simulated one of ours, and its faults cannot be rehearsed. `beside`: throw it
    in a thread, since a vehicle in another process may take its time to answer.
    """

    world: World
    switch: Switch | None
    state: Callable[[], str]
    beside: bool = False
    _on: dict[str, bool] = field(default_factory=dict)
    _path: str = ""

    async def run(self, clock: Clock) -> None:
        """Until cancelled."""
        while True:
            for name, on, fault in self.step(clock.now()):
                if self.switch is None:
                    continue
                if self.beside:
                    await asyncio.to_thread(throw, self.switch, name, on, fault)
                else:
                    throw(self.switch, name, on, fault)
            await clock.sleep(PERIOD_S)

    def step(self, now_s: float) -> list[tuple[str, bool, Any]]:
        """Notice the state that the mission is in; the vehicle's faults that are due to begin or to end."""
        path = self.state()
        if path != self._path:
            self._path = path
            self.world.enter_state(path, now_s)
        due = []
        for name in VEHICLE_FAULTS:
            on = self.world.faults.active(name, now_s)
            if on != self._on.get(name, False):
                self._on[name] = on
                due.append((name, on, getattr(self.world.settings.faults, name)))
        blocked = self.world.settings.faults.executive_blocked
        on = self.world.faults.active("executive_blocked", now_s)
        if on and not self._on.get("executive_blocked", False) and blocked is not None:
            time.sleep(blocked.for_s or 0.0)
        self._on["executive_blocked"] = on
        return due
