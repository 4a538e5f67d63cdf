"""What becomes of an event: pure, so that a replay decides as the flight did."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from mission.executive.events import Severity, event
from mission.executive.queue import Queued
from mission.language import semantics
from mission.language.document import Mission, Transition
from mission.language.semantics import Configuration, Quantities

Autonomy = Literal["full", "confirm", "manual"]
LedTo = Literal["stale", "ignored", "delayed", "asked", "transition"]


@dataclass(frozen=True)
class Decision:
    """stale: what it is about is over. ignored: nothing answers. delayed: `transition` after `delay_s`. asked: when the
    operator says yes. transition: now."""

    led_to: LedTo
    transition: Transition | None = None
    delay_s: float = 0.0


def decide(
    mission: Mission, configuration: Configuration, queued: Queued, quantities: Quantities, autonomy: Autonomy
) -> Decision:
    """What an event leads to in a configuration."""
    if queued.origin is not None and queued.origin not in configuration.active:
        return Decision("stale")
    transition = _answer(mission, configuration, queued, quantities)
    if transition is None:
        return Decision("ignored")
    delay_s = 0.0 if queued.only is not None else semantics.delay_s(transition, configuration)
    if delay_s > 0:
        return Decision("delayed", transition, delay_s)
    if not queued.confirmed and needs_yes(queued.name, transition, autonomy):
        return Decision("asked", transition)
    return Decision("transition", transition)


def needs_yes(name: str, transition: Transition, autonomy: Autonomy) -> bool:
    """Whether an operator is asked first. Never for what is urgent, nor for what an operator wants himself."""
    urgent = any(event(other).severity is not Severity.INFO for other in (name, transition.event))
    if autonomy == "full" or urgent:
        return False
    return autonomy == "manual" or transition.confirm


def autonomy_after(transition: Transition, autonomy: Autonomy) -> Autonomy:
    """An abort waits for nobody's yes, to its end."""
    return "full" if transition.event == "abort" else autonomy


def _answer(
    mission: Mission, configuration: Configuration, queued: Queued, quantities: Quantities
) -> Transition | None:
    only = queued.only
    if only is None:
        return semantics.choose(mission, configuration, queued.name, quantities, queued.origin)
    able = not semantics.used_up(only, configuration) and semantics.guards_hold(only, quantities)
    return only if able and (not only.source or only.source in configuration.active) else None
