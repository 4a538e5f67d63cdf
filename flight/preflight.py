"""Is this vehicle fit to fly beside a turbine: health, battery, position, and the failsafe parameters that would
hurt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isnan
from typing import Literal

from flight.autopilot import Autopilot, AutopilotError, Telemetry

Level = Literal["ok", "warn", "refuse"]
Values = Mapping[str, float]

PARAMETERS = ("COM_OBL_RC_ACT", "COM_OF_LOSS_T", "COM_LOW_BAT_ACT", "NAV_DLL_ACT", "MNT_MODE_IN")
OFFBOARD_LOSS_MAX_S = 1.0  # the autopilot takes over within one second and a half of the last setpoint
POSITION_SIGMA_MAX_M = 5.0

_OFFBOARD_LOSS: Mapping[int, tuple[Level, str]] = {
    0: (
        "refuse",
        "returns to launch: it climbs and flies a straight line home, through the rotor if that is in between",
    ),
    1: ("refuse", "hands over to a pilot, and without one returns to launch, through the rotor if that is in between"),
    2: ("refuse", "hands over to a pilot without position hold"),
    3: (
        "refuse",
        "returns to launch: it climbs and flies a straight line home, through the rotor if that is in between",
    ),
    4: ("ok", "lands where it is"),
    5: ("ok", "holds where it is"),
    7: ("refuse", "disarms in the air: it falls"),
}


@dataclass(frozen=True)
class Finding:
    """One thing looked at: a stable code, how it is, what it says and, where it is not ok, what to do about it."""

    code: str
    level: Level
    text: str
    remedy: str = ""


async def check(
    autopilot: Autopilot,
    *,
    battery_percent: float,
    speed: float = 1.0,
    gimbal: bool = True,
    ours: bool = False,
) -> list[Finding]:
    """Findings in a fixed order; the vehicle is fit where none refuses. `battery_percent` is the least to start with,
    `speed` the simulation's factor, by which PX4's start script multiplies its time-outs. Without `gimbal` none is
    needed from the autopilot. `ours`: the mission may have armed it already, before it was cut off."""
    telemetry = autopilot.telemetry
    findings = [_link(telemetry), _free(telemetry, ours), _armable(telemetry), _position(telemetry)]
    findings.append(_battery(telemetry, battery_percent))
    try:
        values: Values = await autopilot.parameters(PARAMETERS)
    except AutopilotError as error:
        return [*findings, Finding("parameters", "refuse", str(error), "check the link to the autopilot")]
    looks: list[Callable[[Values], Finding]] = [_offboard_loss_action, lambda v: _offboard_loss_time(v, speed)]
    looks += [_low_battery_action, _data_link_action]
    if gimbal:
        looks.append(_gimbal)
    return [*findings, *(look(values) for look in looks)]


def _link(telemetry: Telemetry) -> Finding:
    if telemetry.connected:
        return Finding("link", "ok", "the autopilot is heard")
    return Finding(
        "link", "refuse", f"nothing heard for {telemetry.link_age_s:.1f} s", "check the cable or radio to the autopilot"
    )


def _free(telemetry: Telemetry, ours: bool) -> Finding:
    if telemetry.in_air:
        return Finding("free", "refuse", "it is in the air already: somebody else flies it", "land it first")
    if telemetry.armed and not ours:
        return Finding("free", "refuse", "it is armed already, by somebody else", "disarm it first")
    return Finding("free", "ok", "on the ground, and nobody else's")


def _armable(telemetry: Telemetry) -> Finding:
    if telemetry.armable or telemetry.armed:
        return Finding("armable", "ok", "the autopilot's own checks pass")
    return Finding(
        "armable",
        "refuse",
        "the autopilot's own checks do not pass",
        "wait for its position, or see its messages in a GCS",
    )


def _position(telemetry: Telemetry) -> Finding:
    sigma = telemetry.position_sigma_m
    if isnan(float(telemetry.pose.position[0])):
        return Finding("position", "refuse", "no local position", "wait for GPS, with a free view of the sky")
    if isnan(sigma):
        return Finding("position", "warn", "the autopilot does not say how certain its position is")
    if sigma > POSITION_SIGMA_MAX_M:
        return Finding(
            "position", "refuse", f"position is certain to {sigma:.1f} m only", "wait until GPS has settled below 5 m"
        )
    return Finding("position", "ok", f"position certain to {sigma:.1f} m")


def _battery(telemetry: Telemetry, least: float) -> Finding:
    percent = telemetry.battery_percent
    if isnan(percent):
        return Finding("battery", "refuse", "no battery state", "connect the battery's monitor, or set BAT1_SOURCE")
    if percent < least:
        return Finding(
            "battery", "refuse", f"battery at {percent:.0f} %", f"charge it: the mission wants {least:.0f} % to start"
        )
    return Finding("battery", "ok", f"battery at {percent:.0f} %")


def _offboard_loss_action(values: Values) -> Finding:
    if "COM_OBL_RC_ACT" not in values:
        return _unknown("COM_OBL_RC_ACT")
    value = int(values["COM_OBL_RC_ACT"])
    level, does = _OFFBOARD_LOSS.get(value, ("refuse", "does something that this program does not know"))
    text = f"COM_OBL_RC_ACT is {value}: when setpoints stop, the vehicle {does}"
    remedy = "" if level == "ok" else "set COM_OBL_RC_ACT to 5 (hold), or 4 (land)"
    return Finding("offboard_loss_action", level, text, remedy)


def _offboard_loss_time(values: Values, speed: float) -> Finding:
    if "COM_OF_LOSS_T" not in values:
        return _unknown("COM_OF_LOSS_T")
    wall_s = values["COM_OF_LOSS_T"] / speed
    text = f"COM_OF_LOSS_T is {values['COM_OF_LOSS_T']:g} s" + (
        f", {wall_s:g} s at speed {speed:g}" if speed != 1 else ""
    )
    if wall_s <= OFFBOARD_LOSS_MAX_S + 1e-6:
        return Finding("offboard_loss_time", "ok", text)
    return Finding(
        "offboard_loss_time",
        "refuse",
        f"{text}: too long beside a blade",
        f"set COM_OF_LOSS_T to {OFFBOARD_LOSS_MAX_S * speed:g} s or less",
    )


def _low_battery_action(values: Values) -> Finding:
    if "COM_LOW_BAT_ACT" not in values:
        return _unknown("COM_LOW_BAT_ACT")
    value = int(values["COM_LOW_BAT_ACT"])
    text = f"COM_LOW_BAT_ACT is {value}"
    if value in (0, 2):
        return Finding("low_battery_action", "ok", text)
    return Finding(
        "low_battery_action",
        "warn",
        f"{text}: at a critical battery the vehicle returns to launch in a straight line",
        "set COM_LOW_BAT_ACT to 2 (land); this program goes home long before",
    )


def _data_link_action(values: Values) -> Finding:
    if "NAV_DLL_ACT" not in values:
        return _unknown("NAV_DLL_ACT")
    value = int(values["NAV_DLL_ACT"])
    text = f"NAV_DLL_ACT is {value}"
    if value in (0, 1, 3):
        return Finding("data_link_action", "ok", text)
    return Finding(
        "data_link_action",
        "warn",
        f"{text}: without a ground station the vehicle returns to launch in a straight line, or worse",
        "set NAV_DLL_ACT to 0 (nothing), 1 (hold) or 3 (land)",
    )


def _gimbal(values: Values) -> Finding:
    if values.get("MNT_MODE_IN") == 4:
        return Finding("gimbal", "ok", "the gimbal listens to MAVLink's gimbal protocol v2")
    said = (
        f"MNT_MODE_IN is {values['MNT_MODE_IN']:g}" if "MNT_MODE_IN" in values else "the autopilot has no MNT_MODE_IN"
    )
    return Finding(
        "gimbal",
        "warn",
        f"{said}: it drives no gimbal for this program",
        "set MNT_MODE_IN to 4 and restart the autopilot",
    )


def _unknown(name: str) -> Finding:
    return Finding(
        name.lower(),
        "warn",
        f"the autopilot has no parameter {name}",
        "see what its firmware does instead, before flying",
    )
