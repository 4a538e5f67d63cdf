"""Is every safety event answered in the air, does the way out work blind, and does no mission end up there?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from mission.executive.events import Event, fallbacks
from mission.language.diagnostics import Diagnostic
from mission.language.document import Mission, enclosing
from mission.language.exploration import Exploration, Situation
from mission.language.happening import behaviour_of, happening, safety_events


def unanswered_events(exploration: Exploration) -> Iterator[Diagnostic]:
    """M307: safety events for which an airborne state has no answer that holds without conditions.

    On the way out only failures, deadlines and the pilot need one: what else happens cannot make the vehicle do more
    than leave. Findings about all states inside a composite are reported once, at the composite.
    """
    mission = exploration.mission
    missing: dict[str, dict[str, str]] = {}
    airborne = [leaf for leaf, where in exploration.leaves.items() if any(exploration.flying(one) for one in where)]
    airborne = [leaf for leaf in airborne if mission.states[leaf].final is None]
    for leaf in airborne:
        found = {}
        for event in needed(exploration, leaf):
            weakness = unanswered(mission, leaf, event)
            if weakness is not None:
                found[event.name] = weakness
        missing[leaf] = found
    told: set[tuple[str, str]] = set()
    for leaf in airborne:
        by_place: dict[str, list[str]] = {}
        for name in _roots(missing[leaf]):
            place = _outermost(leaf, name, missing, airborne)
            if (place, name) not in told:
                told.add((place, name))
                by_place.setdefault(place, []).append(name + missing[leaf][name])
        for place, names in by_place.items():
            what = "airborne state" if place == leaf else "state with airborne states inside"
            message = f"the {what} {place!r} does not answer {', '.join(names)}"
            hint = "add it to `on`, here or further out"
            if not place:
                message, hint = f"no airborne state answers {', '.join(names)}", "add it to the mission's own `on`"
            location = mission.states[place].location if place else mission.location
            yield Diagnostic(location, "M307", message, hint)


def _roots(missing: Mapping[str, str]) -> list[str]:
    """Those of the unanswered events that do not fall back to another of them: answering these answers all."""
    return [name for name in missing if not any(other in missing for other in fallbacks(name)[1:])]


def unanswered(mission: Mission, leaf: str, event: Event) -> str | None:
    """Why an event has no sure answer in a leaf: "" nothing, or the conditions it depends on. None: it has one."""
    origins = [leaf]
    if event.name == "timed_out":
        origins = [path for path in enclosing(leaf) if mission.states[path].timeout_s is not None]
    weakness = None
    for origin in origins:
        handlers = mission.handlers(origin, event.name)
        if any(not transition.guarded and transition.retries is None for transition in handlers):
            continue
        weakness = " (only under conditions)" if handlers else ""
    return weakness


def needed(exploration: Exploration, leaf: str) -> Iterator[Event]:
    """Safety events that a leaf must answer."""
    happens = {name for name, _ in happening(exploration.mission, leaf)}
    for event in safety_events():
        leaving = event.lets_go or event.name in ("failed", "behaviour_failed", "timed_out")
        if event.name in happens and (leaving or leaf not in exploration.retreat):
            yield event


def blind_retreat(exploration: Exploration) -> Iterator[Diagnostic]:
    """M308: states on the way out, or entered when vision is lost, whose behaviour needs images."""
    states = exploration.mission.states
    seen: set[str] = set()
    for edge in exploration.all_edges():
        behaviour = behaviour_of(states[edge.target.leaf])
        if behaviour is None or not behaviour.needs_vision or edge.target.leaf in seen:
            continue
        if edge.target.leaf in exploration.retreat:
            seen.add(edge.target.leaf)
            message = f"{behaviour.name} in {edge.target.leaf!r} needs images, on the way out of the mission"
            yield Diagnostic(states[edge.target.leaf].location, "M308", message, "the way out must work blind")
        elif edge.transition.event == "vision_lost" and edge.transition.history is None:
            seen.add(edge.target.leaf)
            message = f"vision_lost leads to {edge.target.leaf!r}, where {behaviour.name} needs images"
            yield Diagnostic(edge.transition.location, "M308", message)


def ends_in_the_air(exploration: Exploration) -> Iterator[Diagnostic]:
    """M309: final states entered while the vehicle may fly, unless somebody else flies it."""
    told: set[str] = set()
    for edge in exploration.all_edges():
        final = exploration.state(edge.target).final
        if final is None or final == "released" or not edge.target.airborne or edge.transition.key in told:
            continue
        told.add(edge.transition.key)
        message = (
            f"the mission can end in {edge.target.leaf!r} while the vehicle flies: {_way(exploration, edge.source)}"
        )
        message += f" → {edge.target.leaf} ({edge.event})"
        yield Diagnostic(edge.transition.location, "M309", message, "land first")


def wrong_side_of_take_off(exploration: Exploration) -> Iterator[Diagnostic]:
    """M310: behaviours that expect to fly and may be started on the ground, or the other way round."""
    told: set[str] = set()
    for situation in exploration.situations:
        state = exploration.state(situation)
        behaviour = behaviour_of(state)
        if behaviour is None or behaviour.airborne is None or state.path in told:
            continue
        if behaviour.airborne and not situation.airborne:
            told.add(state.path)
            message = f"{behaviour.name} needs to fly, but {_way(exploration, situation)} gets there on the ground"
            yield Diagnostic(state.location, "M310", message, "take off first")
        elif not behaviour.airborne and situation.airborne:
            told.add(state.path)
            message = (
                f"{behaviour.name} belongs on the ground, but {_way(exploration, situation)} gets there in the air"
            )
            yield Diagnostic(state.location, "M310", message, "land first")


def _outermost(leaf: str, event: str, missing: dict[str, dict[str, str]], airborne: list[str]) -> str:
    """The outermost state around a leaf all of whose airborne leaves lack the event; "" where all leaves do."""
    if len(airborne) > 1 and all(event in missing[other] for other in airborne):
        return ""
    best = leaf
    for path in enclosing(leaf):
        if all(event in missing[other] for other in airborne if path in enclosing(other)):
            best = path
    return best


def _way(exploration: Exploration, situation: Situation) -> str:
    steps = exploration.trace(situation)
    shown = [step.source.leaf for step in steps] + [situation.leaf]
    return " → ".join(shown if len(shown) <= 6 else [*shown[:3], "…", *shown[-2:]])
