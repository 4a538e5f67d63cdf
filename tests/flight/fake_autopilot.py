"""An autopilot that only remembers what it was told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from flight.autopilot import AutopilotError, Setpoint, Telemetry, VehiclePose

HEALTHY = Telemetry(
    pose=VehiclePose(0.0, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(2)),
    connected=True,
    link_age_s=0.01,
    armed=False,
    in_air=False,
    flight_mode="HOLD",
    armable=True,
    battery_percent=98.0,
    wind=None,
    range_m=None,
    range_age_s=nan,
    global_position=None,
    position_sigma_m=0.4,
)


class FakeAutopilot:
    simulated = True

    def __init__(self, telemetry: Telemetry = HEALTHY, parameters: Mapping[str, float] | None = None) -> None:
        self.telemetry = telemetry
        self.values = dict(parameters or {})
        self.sent: list[Setpoint] = []
        self.started: list[Setpoint] = []
        self.refuses = False

    @property
    def offboard_starts(self) -> int:
        return len(self.started)

    def move_to(self, position: np.ndarray) -> None:
        self.telemetry = replace(self.telemetry, pose=replace(self.telemetry.pose, position=position))

    async def start_offboard(self, first: Setpoint) -> None:
        if self.refuses:
            raise AutopilotError("refused")
        self.started.append(first)

    def send(self, setpoint: Setpoint) -> None:
        if self.refuses:
            raise AutopilotError("no link")
        self.sent.append(setpoint)

    async def parameters(self, names: Sequence[str]) -> Mapping[str, float]:
        if self.refuses:
            raise AutopilotError("the link to the autopilot is lost")
        return {name: self.values[name] for name in names if name in self.values}
