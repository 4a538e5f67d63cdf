"""`# allow: CODE`: findings that a comment on their line silences, and comments that silence nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mission.language.codes import CODES, Level
from mission.language.diagnostics import Diagnostic, near_or_choices
from mission.language.location import Location

_UNREADABLE = ("M005", "M007", "M008", "M104", "M105")


def any_error(findings: Sequence[Diagnostic]) -> bool:
    """Whether one of them keeps a mission from being flown."""
    return any(finding.level is Level.ERROR for finding in findings)


def silenced(
    problems: Sequence[Diagnostic], allowed: Mapping[str, Mapping[int, tuple[str, ...]]], checked: bool
) -> tuple[Diagnostic, ...]:
    """The findings, sorted, each once: without what follows from others or what `# allow: CODE` permits, with those
    about useless permissions."""
    problems = _first_causes(problems)
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
    checked = checked and not any_error(kept)
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


def _first_causes(problems: Sequence[Diagnostic]) -> list[Diagnostic]:
    """Without what is said of a value that could not even be read: it stands there as nothing."""
    unread = {finding.location for finding in problems if finding.code in _UNREADABLE}
    return [finding for finding in problems if finding.code != "M203" or finding.location not in unread]
