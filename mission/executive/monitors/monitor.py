"""What a monitor is: a pure measure of how far a limit is exceeded, and when that becomes an event.

One module of this folder declares each group of them; adding a file is enough.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

from mission.executive.events import EVENTS
from mission.executive.snapshot import Snapshot

Excess = Callable[[Snapshot], float | None]


@dataclass(frozen=True)
class Monitor:
    """One line of the table.

    excess: how far the limit is exceeded: positive when it is, None where that cannot be told (it changes nothing).
    event: raised once when it has been exceeded for `persist_s` without a break. rearm: how far the excess must fall
    below zero before the event may be raised again. restored: the event raised then. limit: the field of `limits:` that
    it watches. airborne: watched in the air alone. wall: it persists in wall seconds, because what it
    waits for does not go faster when mission time does.
    """

    event: str
    limit: str | None
    text: str
    excess: Excess
    persist_s: float
    rearm: float
    restored: str | None
    airborne: bool
    wall: bool


@dataclass(frozen=True)
class Watch:
    """What a monitor remembers: since when the limit is exceeded, and whether the event was raised."""

    since_s: float | None = None
    raised: bool = False
    worst: float = 0.0


_REGISTRY: dict[str, Monitor] = {}


def monitor(
    event: str,
    *,
    limit: str | None = None,
    persist_s: float = 0.0,
    rearm: float = 0.0,
    restored: str | None = None,
    airborne: bool = True,
    wall: bool = False,
) -> Callable[[Excess], Excess]:
    """Register a function as the monitor that raises `event`. Its docstring is what users read."""

    def register(excess: Excess) -> Excess:
        for name in (event, restored):
            if name is not None and name not in EVENTS:
                raise ValueError(f"monitor {excess.__name__}: event {name!r} is not in the event table")
        text = " ".join((excess.__doc__ or "").split())
        _REGISTRY[event] = Monitor(event, limit, text, excess, persist_s, rearm, restored, airborne, wall)
        return excess

    return register


@cache
def monitors() -> Mapping[str, Monitor]:
    """Every monitor of the package by the event it raises, the most severe first."""
    package = __name__.rpartition(".")[0]
    for module in pkgutil.iter_modules(importlib.import_module(package).__path__):
        importlib.import_module(f"{package}.{module.name}")
    return dict(sorted(_REGISTRY.items(), key=lambda item: (EVENTS[item[0]].severity.rank, item[0])))


def look(entry: Monitor, watch: Watch, snapshot: Snapshot) -> tuple[Watch, str | None]:
    """What the monitor remembers after this instant, and the event that it raises now, if any."""
    if entry.airborne and not snapshot.telemetry.in_air:
        return Watch(), None
    excess = entry.excess(snapshot)
    if excess is None:
        return replace(watch, since_s=None), None
    if watch.raised:
        if excess < -entry.rearm or (excess <= 0 and not entry.rearm):
            return Watch(), entry.restored
        return watch, None
    if excess <= 0:
        return Watch(), None
    since = snapshot.now if watch.since_s is None else watch.since_s
    patience = entry.persist_s * snapshot.speed if entry.wall else entry.persist_s
    if snapshot.now - since + 1e-6 < patience:
        return Watch(since, False, max(excess, watch.worst)), None
    return Watch(since, True, max(excess, watch.worst)), entry.event
