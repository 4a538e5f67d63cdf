"""The event table: everything that can happen to a mission, how severe it is, and what the operator reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType


class Severity(StrEnum):
    """Order of urgency. Critical events overtake all others; safety events overtake the operator's and the ordinary."""

    INFO = "info"
    OPERATOR = "operator"
    SAFETY = "safety"
    CRITICAL = "critical"

    @property
    def rank(self) -> int:
        """0 is handled first."""
        return _RANKS[self]


_RANKS = {Severity.CRITICAL: 0, Severity.SAFETY: 1, Severity.OPERATOR: 2, Severity.INFO: 3}


class EventError(ValueError):
    """An event that is not in the table; the message is one line for a person."""


@dataclass(frozen=True)
class Event:
    """One line of the table.

    raised_by: behaviour, monitor, deadline, operator or executive. falls_back_to: the event tried where no state
    on the path handles this one; None means that it is then journalled and otherwise ignored.
    lets_go: no setpoint may follow it, because somebody else flies now.
    """

    name: str
    raised_by: str
    severity: Severity
    text: str
    falls_back_to: str | None = None
    lets_go: bool = False


_I, _O, _S, _C = Severity.INFO, Severity.OPERATOR, Severity.SAFETY, Severity.CRITICAL

_TABLE = (
    Event("timed_out", "deadline", _S, "the state ran longer than its timeout_s", "failed"),
    Event(
        "behaviour_failed", "executive", _S, "the behaviour raised an error or an outcome it never declared", "failed"
    ),
    Event("failed", "behaviour", _S, "the state could not do its work", "abort"),
    Event("abort", "operator", _C, "give up the inspection and bring the vehicle home safely"),
    Event("interrupted", "executive", _C, "the program was told to stop (Ctrl-C or SIGTERM)", "abort"),
    Event(
        "pilot_took_over", "monitor", _C, "a pilot changed the flight mode: the executive lets go at once", lets_go=True
    ),
    Event("too_close", "monitor", _C, "something is nearer than limits.clearance_m", "abort"),
    Event(
        "setpoints_stalled", "executive", _C, "setpoints came too late: the autopilot may have left OFFBOARD", "abort"
    ),
    Event("behaviour_stuck", "executive", _C, "the behaviour ignored cancellation and was abandoned", "abort"),
    Event("battery_critical", "monitor", _C, "the battery is below limits.battery_critical_percent", "battery_low"),
    Event(
        "vehicle_failsafe",
        "monitor",
        _C,
        "the autopilot left OFFBOARD of its own accord and stays out",
        "pilot_took_over",
    ),
    Event("battery_low", "monitor", _S, "the battery is below limits.battery_percent", "abort"),
    Event(
        "standoff_lost", "monitor", _S, "the distance to the blade is off by more than limits.standoff_error_m", "abort"
    ),
    Event(
        "vision_lost",
        "monitor",
        _S,
        "nothing was seen for limits.vision_bridge_s, or the estimate is too vague",
        "abort",
    ),
    Event("wind_high", "monitor", _S, "the wind is above limits.wind_m_s", "abort"),
    Event("link_lost", "monitor", _S, "nothing was heard from the autopilot for limits.link_s", "abort"),
    Event("geofence_breached", "monitor", _S, "the vehicle is farther from home than limits.geofence_m", "abort"),
    Event("gps_degraded", "monitor", _S, "the position is less certain than limits.position_sigma_m", "abort"),
    Event("laser_fault", "monitor", _S, "the laser does not do as it is told", "abort"),
    Event("journal_lost", "executive", _S, "the journal cannot be written any more", "abort"),
    Event("paused", "operator", _O, "hold position until resumed"),
    Event("resumed", "operator", _O, "go on where it was paused"),
    Event("step", "operator", _O, "take the transition that waits for a confirmation"),
    Event("skip", "operator", _O, "go to a state that the mission marks as an entry"),
    Event("link_restored", "monitor", _I, "the autopilot is heard again"),
    Event("vision_restored", "monitor", _I, "the blade is seen again"),
    Event("keep_out_bounded", "executive", _I, "the keep-out volume changed a setpoint"),
)

EVENTS: Mapping[str, Event] = MappingProxyType({entry.name: entry for entry in _TABLE})


def event(name: str) -> Event:
    """The table's entry, or an informational one for an outcome that a registered behaviour declares.

    Raises:
        EventError: neither the table nor any behaviour knows the name.
    """
    known = EVENTS.get(name)
    if known is not None:
        return known
    outcome = outcomes().get(name)
    if outcome is None:
        raise EventError(f"event {name!r} is neither in the event table nor an outcome of any behaviour")
    return outcome


def outcomes() -> Mapping[str, Event]:
    """Outcomes that the registered behaviours declare, beside those that the table already has."""
    from mission.behaviours.behaviour import behaviours

    found: dict[str, Event] = {}
    for behaviour in behaviours().values():
        for name, text in behaviour.outcomes.items():
            if name not in EVENTS:
                found.setdefault(name, Event(name, "behaviour", Severity.INFO, text, "failed"))
    return found


def fallbacks(name: str) -> tuple[str, ...]:
    """The event followed by those it falls back to, in the order in which handlers are sought.

    An outcome that nobody answers (any more: its retries may be used up) falls back to `failed`.
    """
    chain: list[str] = []
    following: str | None = name
    while following is not None and following not in chain:
        chain.append(following)
        known = EVENTS.get(following)
        following = known.falls_back_to if known else "failed"
    return tuple(chain)


def handled_first(names: tuple[str, ...]) -> str:
    """Of events that arrived in the same instant, in this order, the one that is handled first."""
    return min(names, key=lambda name: event(name).severity.rank)
