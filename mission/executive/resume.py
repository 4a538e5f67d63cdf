"""Going on with a run that was cut off: what its journal says, and where that leaves mission and vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flight.autopilot import AutopilotError, Setpoint
from mission.behaviours.behaviour import behaviours
from mission.executive.journal import FORMAT, Entry, read_journal
from mission.executive.monitors.pilot import STICKS
from mission.executive.recollection import UnknownStateError, configuration_of, remembered, station_of
from mission.executive.services import Memory
from mission.language import semantics
from mission.language.semantics import Configuration
from mission.record.lineage import lineage, untouched

if TYPE_CHECKING:
    from mission.executive.services import Services
    from mission.language.document import Mission
    from mission.record.folder import RunFolder

LANDED = "landed"  # the outcome of a behaviour that brings the vehicle down


class ResumeError(RuntimeError):
    """The run cannot be gone on with; the message is one line for a person."""


@dataclass(frozen=True)
class Interrupted:
    """What a run left behind. configuration: its last settled state, with history and used-up retries. t: mission
    seconds of its last line. station_m: how far along the blade it was last said to be. ended: the outcome of a run
    that came to its end before its work was done; another flight goes on with that from the mission's beginning.
    folder: whose journal tells it."""

    configuration: Configuration
    memory: Memory
    t: float
    station_m: float | None = None
    ended: str | None = None
    folder: Path | None = None


def last_of(folder: RunFolder, mission: Mission) -> Interrupted:
    """What the newest of the runs that lead up to this one left behind: one that was cut off before its first decision
    has nothing to say. Where none of them has, nothing was flown yet: the mission's beginning.

    Raises:
        ResumeError, JournalError: as `interrupted`; or a journal is lost of a run that has flown.
    """
    for run in reversed(lineage(folder)):
        if run.journal.exists() and read_journal(run.journal):
            return interrupted(run.journal, mission)
        if not untouched(run):
            raise ResumeError(
                f"{run.journal}: {'empty' if run.journal.exists() else 'missing'}, so nobody knows where that run was "
                "left: look after the vehicle, then fly the mission anew"
            )
    return Interrupted(semantics.start(mission), Memory(), 0.0)


def interrupted(journal: Path, mission: Mission) -> Interrupted:
    """Read the journal of a run that was cut off, a torn last line included, or that ended without having completed.

    Raises:
        ResumeError: it has completed, or belongs to another mission or version of this program.
        JournalError: there is no journal, or it is damaged.
    """
    entries = read_journal(journal)
    if not entries:
        return Interrupted(semantics.start(mission), Memory(), 0.0)
    check_format(journal, entries)
    ended = next((str(entry.fields.get("outcome")) for entry in entries if entry.kind == "end"), None)
    if ended == "completed":
        raise ResumeError(f"{journal.parent}: that run came to its end ({ended}); there is nothing to go on with")
    configuration, memory, station = semantics.start(mission), Memory(), None
    for number, entry in enumerate(entries, 1):
        try:
            if entry.kind in ("start", "transition"):
                configuration, station = configuration_of(entry, mission), None
                if "memory" in entry.fields:
                    memory = remembered(entry.fields["memory"])
            elif entry.kind == "memory":
                memory = remembered(entry.fields)
            elif entry.kind == "progress":
                station = station_of(entry)
        except UnknownStateError as unknown:
            raise ResumeError(
                f"{journal.parent}: it was in {unknown}, which {mission.path.name} does not have; "
                "go on with the mission that was flown"
            ) from None
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise ResumeError(f"{journal}:{number}: this {entry.kind} line was damaged or edited") from error
    if ended is not None:
        configuration, station = semantics.start(mission), None
    return Interrupted(configuration, memory, entries[-1].t, station, ended, journal.parent)


def where(mission: Mission, past: Interrupted, *, in_air: bool) -> Configuration:
    """Where the machine goes on.

    In the air: in the settled state. On the ground: a landing is over, and so is a run that was on its way home from
    an abort; anything else that flies begins anew, from the mission's beginning, with history and what was found out
    still known.
    """
    state = mission.states[past.configuration.leaf]
    behaviour = None if state.do is None else behaviours()[state.do]
    grounded = state.final is not None or (
        behaviour is not None and (behaviour.airborne is False or LANDED in behaviour.outcomes)
    )
    if in_air or grounded:
        return past.configuration
    if semantics.choose(mission, past.configuration, "abort", {}) is None:
        finals = (path for path, other in mission.states.items() if other.final == "aborted")
        return Configuration(next(finals, past.configuration.leaf), past.configuration.history)
    return Configuration(semantics.start(mission).leaf, past.configuration.history)


def restore(services: Services, past: Interrupted, *, in_air: bool) -> None:
    """Remember what was found out. On the ground only what does not depend on where the autopilot's origin is: after a
    change of battery that is another one."""
    known = past.memory
    if in_air:
        services.memory = known
        if known.hub is not None:
            sigma = known.values
            services.refine_turbine(
                services.turbine.refined(
                    hub=np.array(known.hub),
                    heading=known.heading,
                    azimuth=known.azimuth,
                    hub_sigma_m=sigma.get("hub_sigma_m"),
                    heading_sigma=sigma.get("heading_sigma"),
                    azimuth_sigma=sigma.get("azimuth_sigma"),
                )
            )
    else:
        here = services.memory
        here.passes_done, here.inspected = list(known.passes_done), dict(known.inspected)
        here.tip_station_m, here.root_station_m = known.tip_station_m, known.root_station_m
        here.values = {name: value for name, value in known.values.items() if not name.endswith(("_sigma", "_sigma_m"))}
        if known.azimuth is not None:
            # Which blade it is does not depend on the origin; how it is parked is looked at again, from afar.
            services.refine_turbine(services.turbine.refined(azimuth=known.azimuth))
            here.hub = here.heading = None


async def take_up(services: Services, mission: Mission, configuration: Configuration) -> None:
    """Before the settled state begins again in the air: hold here under our setpoints, and look for the blade.

    A vehicle that a pilot flies meanwhile is left to him: the events say so.
    """
    telemetry = services.autopilot.telemetry
    if not telemetry.in_air:
        return
    if telemetry.flight_mode in STICKS:
        services.raise_event("pilot_took_over", mode=telemetry.flight_mode)
        return
    behaviour = behaviours()[state.do] if (state := mission.states[configuration.leaf]).do is not None else None
    if behaviour is not None and (behaviour.airborne is False or LANDED in behaviour.outcomes):
        return  # it was on the ground then, and somebody else has flown it since; or it comes down already
    try:
        pose = telemetry.pose
        await services.setpoints.start(Setpoint(pose.position.copy(), float(pose.attitude[2])))
        await services.autopilot.take_gimbal()
    except AutopilotError as error:
        services.raise_event("abort", error=str(error))
        return
    handlers = mission.handlers(configuration.leaf, "vision_lost")
    if behaviour is None or not behaviour.needs_vision or not any(one.event == "vision_lost" for one in handlers):
        return
    services.perception.watch_blade(True)
    estimate = services.perception.estimate()
    if services.memory.hub is not None and (estimate is None or estimate.age_s > mission.limits.vision_bridge_s):
        services.raise_event("vision_lost", resumed=True)


def check_format(journal: Path, entries: tuple[Entry, ...]) -> None:
    """Refuse what this program cannot read.

    Raises:
        ResumeError: saying why.
    """
    first = entries[0]
    if first.kind != "start":
        raise ResumeError(f"{journal}:1: begins with {first.kind!r}, not with 'start': not the journal of a run")
    found = first.fields.get("format")
    if found != FORMAT:
        raise ResumeError(f"{journal}:1: written in format {found}, this program reads format {FORMAT}")
