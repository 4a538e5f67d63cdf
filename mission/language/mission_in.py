"""Reads a resolved document: its sections, parameters, states, transitions and invariants become a `Mission`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mission.language import invariants
from mission.language.diagnostics import Diagnostic, near_or_choices
from mission.language.document import Mission
from mission.language.limits import Limits
from mission.language.location import Location
from mission.language.resolving import dumped
from mission.language.rig_file import RigFile
from mission.language.silencing import any_error
from mission.language.site_file import SiteFile
from mission.language.sources import shown
from mission.language.states_in import StatesReader
from mission.language.transitions_in import TransitionReader
from mission.language.tree import Node, Scalar, Table, kind, plain
from mission.language.turbine_file import TurbineFile
from mission.language.typed import typed

if TYPE_CHECKING:
    from devices.world.settings import WorldSettings

FIELDS = {
    "mission": "its name",
    "version": "of the format: 1",
    "text": "what the mission is for, for people",
    "turbine": "a turbine file, or its content",
    "rig": "a rig file, or its content",
    "site": "a site file, or its content",
    "world": "the simulated world, laid over the rig file's own",
    "parameters": "values that ${name} refers to",
    "limits": "what the monitors watch",
    "initial": "the state that is entered first",
    "on": "events that are answered in every state",
    "states": "the states",
    "never": "statements that must not become true, proven by mission prove",
    "always_eventually": "statements that must become true again, proven by mission prove",
}
_REQUIRED = ("mission", "version", "turbine", "rig", "site", "initial", "states")
_IN_FILES = ("turbine", "rig", "site")
_WORLDLESS = ("hardware", "recorded")


def mission_of(root: Table, path: Path, problems: list[Diagnostic]) -> Mission | None:
    """The mission, None with findings in `problems`."""
    from devices.world.settings import WorldSettings
    from mission.behaviours.behaviour import behaviours
    from mission.executive.events import EVENTS, outcomes

    start = Location(shown(path), 1, 1)
    for key, entry in root.entries.items():
        if key not in FIELDS:
            problems.append(Diagnostic(entry.key, "M202", f"a mission has no {key!r}", near_or_choices(key, FIELDS)))
    problems.extend(
        Diagnostic(start, "M201", f"the mission needs {key!r}: {FIELDS[key]}")
        for key in _REQUIRED
        if key not in root.entries
    )
    turbine = _section(TurbineFile, root, "turbine", problems)
    rig = _section(RigFile, root, "rig", problems)
    site = _section(SiteFile, root, "site", problems)
    limits = _section(Limits, root, "limits", problems) if "limits" in root.entries else Limits()
    world: WorldSettings | None = None
    if rig is None or rig.kind not in _WORLDLESS:
        world = _section(WorldSettings, root, "world", problems) if "world" in root.entries else WorldSettings()
    elif "world" in root.entries:
        message = f"a {rig.kind} rig has no simulated world"
        problems.append(Diagnostic(root.key_location("world"), "M205", message, "remove `world`"))
    parameters = _parameters(root, problems)
    events = frozenset(EVENTS) | frozenset(outcomes())
    limits_table = root.table("limits") or Table({}, start)
    reader = StatesReader(behaviours(), events, limits_table, problems)
    states_node = root.get("states")
    states = reader.read(states_node) if states_node is not None else {}
    initial = reader.initial(root, "", start) if states and "initial" in root.entries else None
    on_node = root.get("on")
    on = TransitionReader(reader.found, [p for p in states if states[p].children], events, problems)
    transitions = on.read(on_node, "") if on_node is not None else ()
    first = [initial] if initial is not None and "" not in reader.guessed else []
    reader.unnamed(states, first + [transition.target for transition in transitions])
    stated = invariants.read(root, states, problems)
    name = _name(root, problems)
    if turbine is None or rig is None or site is None or limits is None or initial is None or any_error(problems):
        return None
    return Mission(
        name=name,
        version=1,
        states=states,
        initial=initial,
        turbine=turbine,
        rig=rig,
        site=site,
        world=world,
        limits=limits,
        parameters=parameters,
        resolved_yaml=dumped(root, tuple(FIELDS)),
        path=path,
        on=transitions,
        invariants=stated,
        text=root.text("text") or "",
        location=root.key_location("on" if on_node is not None else "states"),
    )


def _section(model: type[Any], root: Table, key: str, problems: list[Diagnostic]) -> Any:
    node = root.get(key)
    if node is None or (isinstance(node, Table) and not node.entries and _blamed(node.location, problems)):
        return None
    place = _section_place(root, key, node)
    found: list[Diagnostic] = []
    section = typed(model, node, place, key, found)
    missing = [finding for finding in found if finding.code == "M201" and finding.location == place]
    if missing and key in _IN_FILES and place == root.key_location(key):
        # Whoever gives a few values means to change those of the file that was named before.
        names = ", ".join(finding.message.split("'")[1] for finding in missing)
        message, hint = f"{key} needs {names}", f"as in {key}: {{extends: FILE, …}}, to change values of a file"
        found = [Diagnostic(place, "M201", message, hint), *(one for one in found if one not in missing)]
    problems.extend(found)
    return section


def _section_place(root: Table, key: str, node: Node) -> Location:
    """Where what is missing in a section is reported: its key, or the beginning of the file that it came from."""
    key_place = root.key_location(key)
    return key_place if node.location.file == key_place.file else node.location


def _blamed(place: Location, problems: Sequence[Diagnostic]) -> bool:
    """Whether a file that was named there has been reported already."""
    return any(finding.location == place for finding in problems) or bool(problems)


def _parameters(root: Table, problems: list[Diagnostic]) -> dict[str, Any]:
    node = root.get("parameters")
    if node is None:
        return {}
    if not isinstance(node, Table):
        problems.append(Diagnostic(node.location, "M203", f"parameters must map names to values, not {kind(node)}"))
        return {}
    for name, entry in node.entries.items():
        if not (name.isidentifier() and name.isascii()):
            problems.append(Diagnostic(entry.key, "M207", f"{name!r} cannot name a parameter", "letters, digits and _"))
    return dict(plain(node))


def _name(root: Table, problems: list[Diagnostic]) -> str:
    node = root.get("mission")
    if node is None:
        return ""
    value = node.value if isinstance(node, Scalar) else None
    if not isinstance(value, str):
        problems.append(Diagnostic(node.location, "M203", f"mission is a name, not {kind(node)}"))
        return ""
    if len(value) > 60 or not value.replace("-", "_").replace("_", "a").isalnum() or not value.isascii():
        hint = "letters, digits, - and _, at most 60: it names the run's folder"
        problems.append(Diagnostic(node.location, "M207", f"{value!r} cannot name a mission", hint))
    return value
