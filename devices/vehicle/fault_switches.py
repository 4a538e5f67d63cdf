"""The faults that can be switched while the vehicle flies: each a method of the same name as its command."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

from devices.vehicle.vehicle import SimulatedVehicle
from devices.world.settings import Wind


class Link(Protocol):
    """What can be cut."""

    up: bool


class FaultSwitches:
    """Throws switches on a vehicle and its links. Commands: gps_jump, battery, wind, gust, link, gimbal, range_finder,
    pilot."""

    def __init__(self, vehicle: SimulatedVehicle, links: Iterable[Link] = ()) -> None:
        self._vehicle, self._links = vehicle, list(links)

    def run(self, name: str, arguments: dict[str, Any]) -> None:
        """Throw a switch by its name.

        Raises:
            ValueError: no such switch, or arguments that it does not take, in one line.
        """
        switch = None if name.startswith("_") or name == "run" else getattr(self, name, None)
        if switch is None:
            raise ValueError("no such switch")
        try:
            switch(**arguments)
        except (TypeError, KeyError, ValueError) as error:
            raise ValueError(" ".join(str(error).split())) from None

    def gps_jump(self, north_m: float, east_m: float, down_m: float = 0.0) -> None:
        """The estimated position jumps."""
        self._vehicle.gps_jump(north_m, east_m, down_m)

    def battery(self, percent: float) -> None:
        """The battery falls to a level."""
        self._vehicle.battery_drop(percent)

    def wind(self, mean_m_s: float, gust_m_s: float, from_deg: float) -> None:
        """Other wind from now on."""
        self._vehicle.wind.set(Wind(mean_m_s=mean_m_s, gust_m_s=gust_m_s, from_deg=from_deg))

    def gust(self, speed_m_s: float, from_deg: float | None = None) -> None:
        """One more gust on top, until called with zero."""
        self._vehicle.wind.add(speed_m_s, from_deg)

    def link(self, up: bool) -> None:
        """Cut every MAVLink link, or mend them."""
        for link in self._links:
            link.up = up

    def gimbal(self, stuck: bool) -> None:
        """The gimbal stays where it is."""
        self._vehicle.gimbal.stuck = stuck

    def range_finder(self, working: bool) -> None:
        """The range finder sees nothing while it does not work."""
        self._vehicle.range_working = working

    def pilot(self, mode: str = "POSCTL") -> None:
        """A safety pilot flips the mode switch."""
        self._vehicle.pilot_takes_over(mode)
