"""The closed vocabulary of guards: named quantities and conditions, with unit, range and meaning.

The executive knows their values (from telemetry, the tracker's estimate and what behaviours have remembered) and hands
them to `Condition.evaluate` under the names declared here; a quantity that is not known at the moment is None.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Quantity:
    """One name that a guard may use. unit: "" for a yes or no. low, high: the values it can take. arguments: what may
    stand in brackets after it; empty where nothing may."""

    name: str
    unit: str
    text: str
    low: float = 0.0
    high: float = float("inf")
    arguments: tuple[str, ...] = ()

    @property
    def is_condition(self) -> bool:
        """A yes or no, which stands alone and is not compared."""
        return not self.unit


_SIDES = ("leading", "trailing")

_TABLE = (
    Quantity("battery_percent", "%", "charge that is left", 0, 100),
    Quantity("station_m", "m", "distance along the blade from its root", -50, 300),
    Quantity("distance_m", "m", "distance from the left lens to the blade, tracked", 0, 200),
    Quantity("sigma_m", "m", "standard deviation of that distance", 0, 100),
    Quantity("vision_age_s", "s", "time since the last accepted observation", 0, 100000),
    Quantity("clearance_m", "m", "distance to the nearest surface that was measured", 0, 1000),
    Quantity("range_m", "m", "forward range finder", 0, 1000),
    Quantity("wind_m_s", "m/s", "mean wind as the autopilot estimates it", 0, 60),
    Quantity("height_m", "m", "height above home", -300, 1000),
    Quantity("home_m", "m", "horizontal distance from home", 0, 20000),
    Quantity("speed_m_s", "m/s", "speed over ground", 0, 60),
    Quantity("position_sigma_m", "m", "uncertainty of the position, as the autopilot claims it", 0, 1000),
    Quantity("link_age_s", "s", "time since the autopilot was last heard", 0, 100000),
    Quantity("elapsed_s", "s", "mission time since the start", 0, 100000),
    Quantity("in_state_s", "s", "time since the present state was entered", 0, 100000),
    Quantity("armed", "", "the motors are armed"),
    Quantity("in_air", "", "the vehicle flies"),
    Quantity("laser_on", "", "the laser throws dots"),
    Quantity("recording", "", "frames are being recorded"),
    Quantity("simulated", "", "the vehicle is a simulated one"),
    Quantity("blade_seen", "", "the last observation of the blade was accepted"),
    Quantity("hub_known", "", "the survey has found the hub"),
    Quantity("tip_known", "", "the tip has been found"),
    Quantity("root_known", "", "the root has been found"),
    Quantity("pass_done", "", "a pass along that side has been completed", arguments=_SIDES),
)

QUANTITIES: Mapping[str, Quantity] = MappingProxyType({quantity.name: quantity for quantity in _TABLE})


def keys() -> tuple[str, ...]:
    """Every key that `Condition.evaluate` may look up: names, and names with each of their arguments."""
    return tuple(
        key
        for quantity in _TABLE
        for key in (
            [f"{quantity.name}({argument})" for argument in quantity.arguments]
            if quantity.arguments
            else [quantity.name]
        )
    )
