"""From a path to a mission: read, compose, override, resolve, type, check. Everything found is reported together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from mission.language import invariants, references
from mission.language import overrides as command_line
from mission.language.codes import CODES, Level
from mission.language.diagnostics import Diagnostic, MissionFileError, near_or_choices
from mission.language.document import Mission
from mission.language.limits import Limits
from mission.language.location import Location
from mission.language.migrations import migrated
from mission.language.rig_file import RigFile
from mission.language.site_file import SiteFile
from mission.language.sources import Sources, mission_root, shown
from mission.language.states_in import StatesReader
from mission.language.transitions_in import TransitionReader
from mission.language.tree import Entry, Node, Scalar, Table, kind, merge, plain
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
_FILES = ("turbine", "rig", "site")
_WORLDLESS = ("hardware", "recorded")


@dataclass(frozen=True)
class Examination:
    """What reading a mission file gave: the mission where there is one, and every finding, in the order of the
    lines."""

    mission: Mission | None
    diagnostics: tuple[Diagnostic, ...]

    @property
    def errors(self) -> tuple[Diagnostic, ...]:
        """Findings that keep it from being flown."""
        return tuple(finding for finding in self.diagnostics if finding.level is Level.ERROR)


def load_mission(path: Path, overrides: Sequence[str] = (), rig: str | None = None) -> Mission:
    """See `document.load`."""
    examination = examine(path, overrides, rig)
    if examination.mission is None or examination.errors:
        raise MissionFileError(examination.errors)
    return examination.mission


def examine(path: Path, overrides: Sequence[str] = (), rig: str | None = None, checked: bool = True) -> Examination:
    """Read and check a mission file; never raises for what is in it.

    checked: without it the checks of the machine as a whole are left out: `mission prove` shows their counterexamples.
    """
    sources = Sources(mission_root(path))
    problems = sources.problems
    mission: Mission | None = None
    document = sources.read(path)
    if document is not None:
        resolved = _resolved(document, path, overrides, rig, sources)
        if resolved is not None:
            mission = _mission(resolved, path, problems)
    if checked and mission is not None and not _errors(problems):
        from mission.language.checks import check

        problems.extend(check(mission))
    findings = _silenced(problems, sources.allowed, checked)
    if mission is not None:
        silenced = {finding.code for finding in problems} - {finding.code for finding in findings}
        if mission.parameters:
            silenced.add("M107")  # references to them are resolved
        header = f"# allow in this file: {', '.join(sorted(silenced))}\n" if silenced else ""
        mission = replace(mission, resolved_yaml=header + mission.resolved_yaml)
    return Examination(None if _errors(findings) else mission, findings)


def _resolved(document: Table, path: Path, overrides: Sequence[str], rig: str | None, sources: Sources) -> Table | None:
    """The whole document in one tree: files inlined, the world lifted, overrides and references applied."""
    problems = sources.problems
    current = migrated(document, problems)
    if current is None:
        return None
    root = current
    if rig is not None:
        place = Location(f"--rig {rig}", 0, 0)
        chosen = Path(rig)
        table = Sources(mission_root(chosen), problems, sources.allowed).read(chosen, place)
        root = root.replacing("rig", table, place) if table is not None else root.without("rig")
        if table is None:
            return None
    for key in _FILES:
        node = root.get(key)
        if isinstance(node, Scalar) and node.value is not None:
            named = sources.named(node, _folder(node.location, path))
            table = sources.read(named, node.location) if named is not None else None
            root = root.replacing(key, table) if table is not None else root.replacing(key, Table({}, node.location))
    root = command_line.apply(_world_lifted(root), overrides, problems)
    return references.resolve(root, problems)


def _folder(place: Location, path: Path) -> Path:
    """The folder of the file in which something stands."""
    return Path(place.file).parent if place.line else path.parent


def _world_lifted(root: Table) -> Table:
    """`rig.world` moved to the top, the mission's own `world` laid over it."""
    rig = root.table("rig")
    below = rig.table("world") if rig is not None else None
    if rig is None or below is None:
        return root
    above = root.table("world")
    world = merge(below, above) if above is not None else below
    place = root.key_location("world") if above is not None else rig.key_location("world")
    entries = {**root.entries, "rig": Entry(root.key_location("rig"), rig.without("world"))}
    return Table({**entries, "world": Entry(place, world)}, root.location, root.size)


def _mission(root: Table, path: Path, problems: list[Diagnostic]) -> Mission | None:
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
    if turbine is None or rig is None or site is None or limits is None or initial is None or _errors(problems):
        return None
    return Mission(
        name=name,
        version=1,
        states=states,
        initial=initial,
        turbine=turbine,
        rig=_rig_with_paths(rig, root, path),
        site=site,
        world=world,
        limits=limits,
        parameters=parameters,
        resolved_yaml=_dumped(root),
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
    return typed(model, node, _section_place(root, key, node), key, problems)


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
        if not name.isidentifier():
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


def _rig_with_paths(rig: RigFile, root: Table, path: Path) -> RigFile:
    """The rig with the files that it names as absolute paths, seen from the rig file."""
    table = root.table("rig")
    changes: dict[str, str] = {}
    for key in ("camchain", "frames"):
        node = table.get(key) if table is not None else None
        if isinstance(node, Scalar) and isinstance(node.value, str):
            changes[key] = str((_folder(node.location, path) / node.value).absolute())
    return rig.model_copy(update=changes) if changes else rig


def _dumped(root: Table) -> str:
    return yaml.dump(
        plain(root), Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None
    )


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """Writes what the loader reads back: no anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _errors(findings: Sequence[Diagnostic]) -> bool:
    return any(finding.level is Level.ERROR for finding in findings)


def _silenced(
    problems: Sequence[Diagnostic], allowed: dict[str, dict[int, tuple[str, ...]]], checked: bool
) -> tuple[Diagnostic, ...]:
    """Findings without those that `# allow: CODE` permits, with those about useless permissions; sorted, each once."""
    kept: list[Diagnostic] = []
    used: set[tuple[str, int, str]] = set()
    for finding in dict.fromkeys(problems):
        place = finding.location
        lines = allowed.get(place.file, {})
        codes = (*lines.get(place.line, ()), *lines.get(0, ()))
        if finding.code in codes and CODES[finding.code].allowed:
            used.add((place.file, place.line, finding.code))
        else:
            kept.append(finding)
    checked = checked and not _errors(kept)
    for file, asked in allowed.items():
        for line, names in asked.items():
            for code in names:
                place = Location(file, max(line, 1), 1)
                if code not in CODES:
                    hint = near_or_choices(code, CODES)
                    kept.append(Diagnostic(place, "M108", f"allow: there is no code {code!r}", hint))
                elif not CODES[code].allowed:
                    kept.append(Diagnostic(place, "M108", f"allow: {code} cannot be silenced", CODES[code].text))
                elif line and (file, line, code) not in used and checked:
                    kept.append(Diagnostic(place, "M108", f"allow: nothing on this line raises {code}", "remove it"))
    return tuple(sorted(kept, key=lambda finding: (finding.location, finding.level is Level.WARNING, finding.code)))
