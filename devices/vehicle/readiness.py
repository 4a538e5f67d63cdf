"""What keeps the autopilot from arming, or from flying a mode."""

from __future__ import annotations

from typing import TYPE_CHECKING

from devices.vehicle.battery import Battery
from devices.vehicle.estimator import VALID_AFTER_S
from devices.vehicle.modes import Mode

if TYPE_CHECKING:
    from devices.vehicle.firmware import Firmware


def not_armable(firmware: Firmware, battery: Battery) -> str | None:
    """Why it would refuse to arm, None when it would not."""
    if firmware.time_s < VALID_AFTER_S:
        return "no valid position estimate yet"
    if battery.percent < 100 * float(firmware.parameters["BAT_CRIT_THR"]):
        return "battery critical"
    if firmware.mode in (Mode.LAND, Mode.RTL):
        return "mode not suitable for take-off"
    return not_flyable(firmware, firmware.intended)


def not_flyable(firmware: Firmware, mode: Mode) -> str | None:
    """Why it would refuse to fly a mode, None when it would not."""
    if mode is Mode.OFFBOARD and not firmware.offboard_fresh:
        return "no offboard signal"
    if mode.piloted and not firmware.has_pilot:
        return "no manual control"
    if mode is Mode.MISSION:
        return "no mission"
    if mode.automatic and firmware.time_s < VALID_AFTER_S:
        return "no valid position estimate yet"
    return None
