"""Reads a mission's files and puts them together: `extends` and `include`, every place kept, no path leading
outside."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from mission.language.diagnostics import Diagnostic, printable, suggestion
from mission.language.location import Location
from mission.language.shapes import misshapen
from mission.language.tree import Entry, Items, Node, Scalar, Table, merge
from mission.language.yaml_text import LONGEST_TEXT, UnreadableError, allowances, parse

COMPOSING = ("extends", "include")
_MOST_FILES = 60


@dataclass
class Sources:
    """All files read for one mission. root: the folder that no path may leave. allowed: file → line → codes."""

    root: Path
    problems: list[Diagnostic] = field(default_factory=list)
    allowed: dict[str, dict[int, tuple[str, ...]]] = field(default_factory=dict)
    incomplete: bool = False  # a file that should lie below is not there: whatever else is missing may be in it
    _reads: int = 0

    def read(self, path: Path, asked: Location | None = None) -> Table | None:
        """The composed mapping of a file, None where there is none; findings go to `problems`.

        asked: the place that names the file, which is blamed when it does not exist.
        """
        return self._read(path, asked, ())

    def named(self, scalar: Scalar, folder: Path) -> Path | None:
        """The file that a value names, seen from the folder of the file it stands in; None with a finding if
        unusable."""
        if not isinstance(scalar.value, str) or not scalar.value.strip():
            self.problems.append(Diagnostic(scalar.location, "M203", "the name of a file is expected here"))
            return None
        return self.within(scalar.value, folder, scalar.location)

    def within(self, name: str, folder: Path, place: Location) -> Path | None:
        """A path that stays inside `root`, symbolic links followed."""
        try:
            path = (folder / name).resolve()
            inside = path.is_relative_to(self.root.resolve()) and not Path(name).is_absolute()
        except (OSError, ValueError, RuntimeError):
            self.problems.append(Diagnostic(place, "M103", f"{name!r} is not a usable path"))
            return None
        if not inside:
            hint = f"files of a mission lie inside {shown(self.root)}"
            self.problems.append(Diagnostic(place, "M103", f"{name!r} leads outside the mission's folder", hint))
            return None
        return _tidy(folder / name, path)

    def _read(self, path: Path, asked: Location | None, chain: tuple[Path, ...]) -> Table | None:
        file = shown(path)
        self._reads += 1
        try:
            if self._reads > _MOST_FILES:
                if self._reads > _MOST_FILES + 1:
                    return None
                raise UnreadableError(
                    Diagnostic(asked or Location(file, 1, 1), "M102", f"more than {_MOST_FILES} files are included")
                )
            if (real := _real(path)) in chain:
                circle = " → ".join(shown(link) for link in (*chain[chain.index(real) :], path))
                raise UnreadableError(
                    Diagnostic(asked or Location(file, 1, 1), "M102", f"files include each other: {circle}")
                )
            text = read_text(path, asked)
            self.allowed[file] = allowances(text)
            table = parse(text, file, self.problems)
            self.problems.extend(misshapen(table))
        except UnreadableError as error:
            self.problems.append(error.diagnostic)
            return None
        return self._composed(table, path.parent, (*chain, _real(path)))

    def _composed(self, node: Table, folder: Path, chain: tuple[Path, ...]) -> Table:
        entries: dict[str, Entry] = {}
        for key, entry in node.entries.items():
            if key not in COMPOSING:
                entries[key] = Entry(entry.key, self._inside(entry.node, folder, chain), entry.first)
        own = Table(entries, node.location, node.size)
        below: Table | None = None
        for key in COMPOSING:
            for scalar in self._names(node.get(key), key):
                path = self.named(scalar, folder)
                table = self._read(path, scalar.location, chain) if path else None
                if table is None:
                    self.incomplete = True
                else:
                    below = table if below is None else merge(below, table)
        return own if below is None else merge(below, own)

    def _inside(self, node: Node, folder: Path, chain: tuple[Path, ...]) -> Node:
        if isinstance(node, Table):
            return self._composed(node, folder, chain)
        return node

    def _names(self, node: Node | None, key: str) -> list[Scalar]:
        if node is None:
            return []
        nodes = node.items if isinstance(node, Items) else (node,)
        for item in nodes or (node,):
            if not isinstance(item, Scalar):
                self.incomplete = True
                self.problems.append(
                    Diagnostic(item.location, "M203", f"{key} takes the name of a file, or a list of names")
                )
        return [item for item in nodes if isinstance(item, Scalar)]


def read_text(path: Path, asked: Location | None = None) -> str:
    """The text of a file.

    Raises:
        UnreadableError: it does not exist, is no file, is too large, or is not UTF-8.
    """
    file = shown(path)
    place = Location(file, 1, 1)
    what = _no_file(path)
    if what:
        hint = _near_file(path)
        if asked is None:
            raise UnreadableError(Diagnostic(Location(file, 0, 0), "M001", f"the file {what}", hint))
        raise UnreadableError(Diagnostic(asked, "M101", f"the file {file} {what}", hint))
    try:
        with path.open("rb") as stream:
            data = stream.read(LONGEST_TEXT + 1)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise UnreadableError(Diagnostic(place, "M001", f"the file cannot be read: {reason}")) from None
    if len(data) > LONGEST_TEXT:
        raise UnreadableError(Diagnostic(place, "M001", f"the file is larger than {LONGEST_TEXT // 1000} kB"))
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - (data.rfind(b"\n", 0, error.start) + 1) + 1
        raise UnreadableError(
            Diagnostic(Location(file, line, column), "M001", "the text is not UTF-8", "save the file as UTF-8")
        ) from None


def mission_root(path: Path) -> Path:
    """The folder whose files a mission may use: the one called `missions` around it, or else the mission's own."""
    folder = _real(path).parent
    return next((parent for parent in (folder, *folder.parents) if parent.name == "missions"), folder)


def shown(path: Path) -> str:
    """A path as messages show it: relative to the working folder where it lies inside."""
    try:
        absolute = Path(path) if path.is_absolute() else Path.cwd() / path
        parts = [part for part in absolute.parts if part != "."]
        tidy = Path(*parts)
        return str(tidy.relative_to(Path.cwd())) if tidy.is_relative_to(Path.cwd()) else str(path)
    except (OSError, ValueError):
        return printable(str(path))


def _tidy(path: Path, real: Path) -> Path:
    """The path without its detours (`a/../b`), where that is the same file; `a` may be a link to elsewhere."""
    short = Path(os.path.normpath(path))
    return short if short.resolve() == real else path


def _real(path: Path) -> Path:
    """The path with links followed, where that is possible."""
    try:
        return path.resolve()
    except (OSError, ValueError, RuntimeError):
        return path


def _no_file(path: Path) -> str:
    """Why a path is no plain file; empty where it is one."""
    try:
        if path.is_file():
            return ""
        return "is a folder" if path.is_dir() else "does not exist" if not path.exists() else "is not a plain file"
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        return f"cannot be looked for: {reason.lower()}"


def _near_file(path: Path) -> str:
    try:
        near = [other for other in path.parent.iterdir() if other.suffix in (".yaml", ".yml")][:200]
        names = [other.name for other in near if other.is_file()]
    except (OSError, ValueError):
        return ""
    return suggestion(path.name, names)
