"""What the autopilot does when something is lost: the companion's setpoints, the battery, the ground station."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from devices.vehicle.battery import Battery
from devices.vehicle.modes import Mode
from devices.vehicle.results import Severity

if TYPE_CHECKING:
    from devices.vehicle.firmware import Firmware

_OFFBOARD_BACK_S = 0.04
_BATTERY_HOLD_S = 5.0
_GCS_GRACE_S = 2.0


class Failsafes:
    """Watches every control cycle; `reason` is the failsafe that acts now, None while none does."""

    def __init__(
        self,
        firmware: Firmware,
        battery: Battery,
        note: Callable[..., None],
        say: Callable[[Severity, str], None],
    ) -> None:
        self._firmware, self._battery, self._note, self._say = firmware, battery, note, say
        self.reason: str | None = None
        self._back_s: float | None = None
        self._battery_stage = 0
        self._battery_act_s = 0.0
        self._gcs_s: float | None = None
        self._gcs_lost = False

    def end(self) -> None:
        """Whoever flies has chosen something else."""
        if self.reason is not None:
            self._note("failsafe_ended", reason=self.reason)
            self.reason = None

    def forget_battery(self) -> None:
        """Judge the battery afresh, as after a landing."""
        self._battery_stage = 0

    def gcs_heartbeat(self) -> None:
        """A ground station was heard."""
        if self._gcs_lost:
            self._gcs_lost = False
            self._note("datalink_regained")
        self._gcs_s = self._firmware.time_s

    def watch_offboard(self) -> None:
        """The setpoints stopped, or came back."""
        firmware = self._firmware
        if firmware.intended is not Mode.OFFBOARD:
            return
        if self.reason == "offboard_lost":
            if firmware.offboard_fresh:
                self._back_s = self._back_s if self._back_s is not None else firmware.time_s
                if firmware.time_s - self._back_s >= _OFFBOARD_BACK_S:
                    self.end()
                    firmware.enter(Mode.OFFBOARD)
            else:
                self._back_s = None
        elif self.reason is None and not firmware.offboard_fresh:
            action = int(firmware.parameters["COM_OBL_RC_ACT"])
            if action == 7:
                self._note(
                    "failsafe",
                    reason="offboard_lost",
                    action="DISARM",
                    setpoint_s=round(firmware.setpoint_s or 0.0, 3),
                )
                firmware.drop("offboard_lost")
                return
            modes = {4: Mode.LAND, 5: Mode.HOLD}
            if firmware.has_pilot:
                modes |= {0: Mode.POSCTL, 1: Mode.ALTCTL, 2: Mode.MANUAL}
            self._act("offboard_lost", modes.get(action, Mode.RTL))
            self._back_s = None

    def watch_battery(self) -> None:
        """It warns, holds for a while, then lands; and lands at once in an emergency."""
        firmware = self._firmware
        left, p = self._battery.percent / 100, firmware.parameters
        action = int(p["COM_LOW_BAT_ACT"])
        if self._battery_stage == 0 and left < float(p["BAT_LOW_THR"]):
            self._battery_stage = 1
            self._note("battery_low", percent=self._battery.percent)
            self._say(Severity.WARNING, "Low battery level")
        if self._battery_stage == 1 and left < float(p["BAT_CRIT_THR"]):
            self._battery_stage = 2
            self._say(Severity.CRITICAL, "Critical battery level! Return now")
            if action in (2, 3) and not firmware.mode.piloted and firmware.mode not in (Mode.LAND, Mode.RTL):
                self._act("battery_critical", Mode.HOLD)
                self._battery_act_s = firmware.time_s + _BATTERY_HOLD_S
        holding = self.reason == "battery_critical" and firmware.mode is Mode.HOLD
        if holding and firmware.time_s >= self._battery_act_s:
            self._act("battery_critical", Mode.LAND)
        if self._battery_stage == 2 and left < float(p["BAT_EMERGEN_THR"]):
            self._battery_stage = 3
            self._say(Severity.CRITICAL, "Emergency battery level! Land immediately")
            if action in (2, 3) and not firmware.mode.piloted and firmware.mode is not Mode.LAND:
                self._act("battery_emergency", Mode.LAND)

    def watch_datalink(self) -> None:
        """A ground station that was heard once is heard no more."""
        firmware = self._firmware
        if self._gcs_s is None or self._gcs_lost:
            return
        limit = float(firmware.parameters["COM_DL_LOSS_T"])
        if firmware.time_s - self._gcs_s < limit * (1 + _GCS_GRACE_S / 10):
            return
        self._gcs_lost = True
        self._note("datalink_lost")
        self._say(Severity.WARNING, "Connection to ground station lost")
        modes = {1: Mode.HOLD, 2: Mode.RTL, 3: Mode.LAND}
        action = modes.get(int(firmware.parameters["NAV_DLL_ACT"]))
        if action is not None and firmware.armed and not firmware.mode.piloted and self.reason is None:
            self._act("datalink_lost", action)

    def _act(self, reason: str, mode: Mode) -> None:
        self.reason = reason
        self._note("failsafe", reason=reason, action=mode.name, setpoint_s=round(self._firmware.setpoint_s or 0.0, 3))
        self._say(Severity.CRITICAL, f"Failsafe activated: {reason.replace('_', ' ')}, {mode.name}")
        self._firmware.enter(mode)
