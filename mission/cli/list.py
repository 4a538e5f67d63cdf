"""List what missions are made of: behaviours, events, conditions, invariants, monitors, limits, codes."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer


class Subject(StrEnum):
    """What can be listed."""

    BEHAVIOURS = "behaviours"
    EVENTS = "events"
    CONDITIONS = "conditions"
    INVARIANTS = "invariants"
    MONITORS = "monitors"
    CODES = "codes"
    LIMITS = "limits"


def list_(
    what: Annotated[Subject, typer.Argument(help="What to list.")],
    as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
) -> None:
    """List the words of the mission language with their documentation, generated from the code.

    \b
    Examples:
      mission list behaviours
      mission list events --json
    """
    from mission.language.catalogue import catalogue, shown

    entries = catalogue(str(what))
    if as_json:
        import json

        print(json.dumps([entry.as_json() for entry in entries], indent=2, ensure_ascii=False))
    else:
        print(shown(entries))
