"""`--set a.b=value`: changes to the resolved document from the command line, each blamed by its own text."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mission.language.diagnostics import Diagnostic, near_or_choices
from mission.language.location import Location
from mission.language.tree import Entry, Items, Scalar, Table
from mission.language.yaml_text import UnreadableError, parse_value

_PATH = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")

# Sections that may be begun by an override: their models say what belongs into them.
_OPEN = ("world", "limits", "parameters", "turbine", "rig", "site")
_FIXED = ("mission", "version")


def apply(root: Table, overrides: Sequence[str], problems: list[Diagnostic]) -> Table:
    """The document with every override in place; those that cannot be applied are reported."""
    for override in overrides:
        place = Location(f"--set {override}", 0, 0)
        path, equals, text = override.partition("=")
        path = path.strip()
        if not equals or not _PATH.fullmatch(path):
            problems.append(
                Diagnostic(place, "M106", "an override is written path=value, as in turbine.azimuth_deg=90")
            )
            continue
        try:
            value = parse_value(text, place.file)
        except UnreadableError as error:
            problems.append(Diagnostic(place, "M106", f"the value is not YAML: {error.diagnostic.message}"))
            continue
        steps = path.split(".")
        if steps[0] in _FIXED:
            problems.append(Diagnostic(place, "M106", f"{steps[0]} cannot be overridden"))
            continue
        if steps[0] in ("turbine", "rig", "site") and len(steps) == 1 and isinstance(value, Scalar):
            hint = "use --rig FILE" if steps[0] == "rig" else f"set its values, as in {steps[0]}.name=…"
            problems.append(Diagnostic(place, "M106", f"a whole {steps[0]} cannot be set to a file's name", hint))
            continue
        changed = _set(root, steps, (), value, place, problems)
        if changed is not None:
            root = changed
    return root


def _set(
    table: Table,
    steps: list[str],
    done: tuple[str, ...],
    value: Scalar | Items | Table,
    place: Location,
    problems: list[Diagnostic],
) -> Table | None:
    step, rest = steps[0], steps[1:]
    if not rest:
        return table.replacing(step, value, place)
    inner = table.get(step)
    if inner is None or (isinstance(inner, Scalar) and inner.value is None):
        if (done or (step,))[0] not in _OPEN:
            where = f"in {'.'.join(done)}" if done else "in the resolved mission"
            hint = near_or_choices(step, [*table.entries, *(() if done else _OPEN)])
            problems.append(Diagnostic(place, "M106", f"there is no {step!r} {where}", hint))
            return None
        inner = Table({}, place)
    if not isinstance(inner, Table):
        problems.append(Diagnostic(place, "M106", f"{'.'.join((*done, step))} is a value with nothing inside"))
        return None
    changed = _set(inner, rest, (*done, step), value, place, problems)
    if changed is None:
        return None
    entries = {**table.entries, step: Entry(table.key_location(step) if step in table.entries else place, changed)}
    return Table(entries, table.location, table.size + value.size)
