"""From a path to a mission: read, compose, override, resolve, type, check. Everything found is reported together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mission.language.codes import Level
from mission.language.diagnostics import Diagnostic, MissionFileError
from mission.language.document import Mission
from mission.language.mission_in import mission_of
from mission.language.resolving import resolved
from mission.language.silencing import any_error, silenced
from mission.language.sources import Sources, mission_root


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
    if document is not None and not sources.incomplete:
        root = resolved(document, path, overrides, rig, sources)
        if root is not None:
            mission = mission_of(root, path, problems)
    if checked and mission is not None and not any_error(problems):
        from mission.language.checks import check

        problems.extend(check(mission))
    findings = silenced(problems, sources.allowed, checked)
    if mission is not None:
        quiet = {finding.code for finding in problems} - {finding.code for finding in findings}
        if mission.parameters:
            quiet.add("M107")  # references to them are resolved
        header = f"# allow in this file: {', '.join(sorted(quiet))}\n" if quiet else ""
        mission = replace(mission, resolved_yaml=header + mission.resolved_yaml)
    return Examination(None if any_error(findings) else mission, findings)
