"""What a journal's lines say of a run that is to be gone on with: where the machine was, and what was known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Annotated, Any

from pydantic import ConfigDict, Field, TypeAdapter, with_config

from mission.executive.journal import Entry
from mission.executive.services import Memory, Stretch
from mission.language.document import Mission
from mission.language.semantics import Configuration

_FINITE = ConfigDict(allow_inf_nan=False)
_MEMORY = TypeAdapter(with_config(_FINITE)(Memory))
_HISTORY = TypeAdapter(dict[str, str])
_TAKEN = TypeAdapter(dict[str, Annotated[int, Field(ge=0)]])
_STATION = TypeAdapter(float, config=_FINITE)


def remembered(recorded: Mapping[str, Any]) -> Memory:
    """Memory as a journal's line has it; names that are not known any more are passed over.

    Raises:
        ValueError, TypeError: it is none.
    """
    known = {entry.name: recorded[entry.name] for entry in fields(Memory) if entry.name in recorded}
    known["inspected"] = {side: Stretch(**stretch) for side, stretch in dict(known.get("inspected", {})).items()}
    return _MEMORY.validate_python(known)


def configuration_of(entry: Entry, mission: Mission) -> Configuration:
    """Where the machine was from this line on.

    Raises:
        ValueError, KeyError: the line does not say it. UnknownStateError: it names one that the mission does not have.
    """
    leaf = entry.fields["to"] if entry.kind == "transition" else entry.fields["state"]
    history = _HISTORY.validate_python(entry.fields.get("history", {}))
    for path in (leaf, *history.values()):
        if path not in mission.states or mission.states[path].children:
            raise UnknownStateError(path)
    return Configuration(leaf, history, _TAKEN.validate_python(entry.fields.get("taken", {})))


def station_of(entry: Entry) -> float:
    """How far along the blade it was.

    Raises:
        ValueError, KeyError: the line does not say it.
    """
    return _STATION.validate_python(entry.fields["station_m"])


class UnknownStateError(LookupError):
    """The mission has no such innermost state."""
