"""Puts a mission into one tree: files inlined, the world lifted out of the rig, overrides and references applied."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from mission.language import overrides as command_line
from mission.language import references
from mission.language.diagnostics import Diagnostic
from mission.language.location import Location
from mission.language.migrations import migrated
from mission.language.sources import Sources, mission_root, shown
from mission.language.tree import Entry, Scalar, Table, merge, plain

_FILES = ("turbine", "rig", "site")


def resolved(document: Table, path: Path, overrides: Sequence[str], rig: str | None, sources: Sources) -> Table | None:
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
    return references.resolve(_calibration_placed(root, path, sources), problems)


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


def _calibration_placed(root: Table, path: Path, sources: Sources) -> Table:
    """`rig.camchain` as an absolute path, seen from the rig file: what is recorded must find it again.

    The recorded mission of a run is the only one that may name it absolutely itself.
    """
    rig = root.table("rig")
    node = rig.get("camchain") if rig is not None else None
    if rig is None or not isinstance(node, Scalar) or not isinstance(node.value, str):
        return root
    if Path(node.value).is_absolute() and (path.parent / "journal.jsonl").exists():
        return root
    place = node.used_at or node.location
    chosen = Sources(mission_root(Path(place.file)), sources.problems) if place.line else sources
    named = chosen.within(node.value, _folder(place, path), node.location)
    if named is None:
        return root
    if not named.is_file():
        sources.problems.append(Diagnostic(node.location, "M101", f"the file {shown(named)} does not exist"))
    return root.replacing("rig", rig.replacing("camchain", Scalar(str(named.absolute()), node.location)))


def dumped(root: Table, order: Sequence[str]) -> str:
    """The tree as YAML text, its outermost keys in this order, with nothing left to resolve."""
    document = {key: plain(root.entries[key].node) for key in order if key in root.entries}
    return yaml.dump(document, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None)


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """Writes what the loader reads back: no anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True
