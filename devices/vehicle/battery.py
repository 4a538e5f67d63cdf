"""A four-cell battery that empties with the thrust it has to give."""

from __future__ import annotations

from devices.vehicle.body import GRAVITY

CELLS = 4
CAPACITY_MAH = 5200.0
_IDLE_SHARE = 0.02


class Battery:
    """Charge in percent, voltage and current. `minutes` is the hover time of a full battery."""

    def __init__(self, percent: float, minutes: float) -> None:
        self.percent = percent
        self._hover_percent_s = 100.0 / (60.0 * minutes)
        self._hover_a = CAPACITY_MAH / 1000.0 * 60.0 / minutes
        self.current_a = 0.0

    @property
    def cell_v(self) -> float:
        """Voltage of one cell under load."""
        return 3.5 + 0.65 * self.percent / 100.0 - 0.002 * self.current_a

    @property
    def voltage_v(self) -> float:
        return CELLS * self.cell_v

    @property
    def consumed_mah(self) -> float:
        return CAPACITY_MAH * (1.0 - self.percent / 100.0)

    @property
    def remaining_s(self) -> float:
        """Seconds of hover that are left."""
        return self.percent / self._hover_percent_s

    def step(self, armed: bool, thrust: float, seconds: float) -> None:
        """Use it for so many seconds at a specific thrust in m/s²."""
        load = max((thrust / GRAVITY) ** 1.5, _IDLE_SHARE) if armed else _IDLE_SHARE / 2
        self.current_a = load * self._hover_a
        self.percent = max(self.percent - load * self._hover_percent_s * seconds, 0.0)
