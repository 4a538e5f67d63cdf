"""The JSON Schema of mission files, generated from the models and registries that the loader itself uses."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from mission.language import mission_in, states_in, transitions_in
from mission.language.document import OUTCOMES
from mission.language.limits import Limits
from mission.language.migrations import VERSION
from mission.language.quantities import QUANTITIES
from mission.language.rig_file import RigFile
from mission.language.site_file import SiteFile
from mission.language.turbine_file import TurbineFile

SHIPPED = Path(__file__).with_name("mission.schema.json")
_REFERENCE = {"type": "string", "pattern": r"\$\{[A-Za-z_]\w*\}"}
_FILES = {"oneOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}
_COMPOSING = {
    "extends": {**_FILES, "description": "files that this is laid over"},
    "include": {**_FILES, "description": "files that this is laid over, after those of extends"},
}
_NESTED = ("properties", "$defs")
_LISTED = ("anyOf", "oneOf", "allOf")
_WRAPPED = ("additionalProperties", "items", "then")


def schema_text() -> str:
    """The schema as it is shipped."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


def schema() -> dict[str, Any]:
    """The schema of a mission file (draft 2020-12)."""
    from devices.world.settings import WorldSettings
    from mission.behaviours.behaviour import behaviours
    from mission.executive.events import EVENTS, outcomes

    definitions: dict[str, Any] = {}
    turbine, rig, site = (_model(model, definitions) for model in (TurbineFile, RigFile, SiteFile))
    world, limits = _model(WorldSettings, definitions), _model(Limits, definitions)
    rig["properties"]["world"] = world
    events = {name: event.text for name, event in EVENTS.items()}
    for name in outcomes():
        ends = [f"{one.name}: {one.outcomes[name]}" for one in behaviours().values() if name in one.outcomes]
        events[name] = "; ".join(ends)
    condition = {
        "type": "string",
        "description": "A condition over: " + ", ".join(QUANTITIES),
        "examples": ["battery_percent > 40", "tip_known and not pass_done(trailing)"],
    }
    transition = _described(
        {
            "to": {"type": "string"},
            "when": condition,
            "unless": condition,
            "after_s": {"type": "number", "minimum": 0},
            "retries": {"type": "integer", "minimum": 1, "maximum": 1000},
            "backoff_s": {"type": "number", "minimum": 0, "maximum": 3600},
            "history": {"enum": ["shallow", "deep"]},
            "confirm": {"type": "boolean"},
        },
        transitions_in.FIELDS,
    )
    answer = [{"type": "string"}, {"type": "null"}, _object(transition)]
    definitions["answer"] = {"anyOf": [*answer, {"type": "array", "items": {"anyOf": answer}, "minItems": 1}]}
    definitions["on"] = {
        "type": "object",
        "properties": {name: {"$ref": "#/$defs/answer", "description": text} for name, text in sorted(events.items())},
        "additionalProperties": False,
    }
    state = _described(
        {
            "do": {"enum": sorted(behaviours())},
            "with": {"type": "object"},
            "timeout_s": {"type": "number", "exclusiveMinimum": 0},
            "on": {"$ref": "#/$defs/on"},
            "initial": {"type": "string"},
            "states": {"$ref": "#/$defs/states"},
            "final": {"type": "boolean"},
            "outcome": {"enum": list(OUTCOMES)},
            "limits": {**limits},
            "entry": {"type": "boolean"},
            "text": {"type": "string"},
            "parameters": {"type": "object"},
        },
        states_in.FIELDS,
    )
    definitions["state"] = _object(state) | {
        "allOf": [
            {
                "if": {"properties": {"do": {"const": name}}, "required": ["do"]},
                "then": {"properties": {"with": _model(behaviour.parameters, definitions)}},
            }
            for name, behaviour in behaviours().items()
        ]
    }
    definitions["states"] = {
        "type": "object",
        "propertyNames": {"pattern": "^[A-Za-z][A-Za-z0-9_]{0,39}$"},
        "additionalProperties": {"$ref": "#/$defs/state"},
    }
    statements = {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}
    properties = _described(
        {
            "mission": {"type": "string", "pattern": "^[A-Za-z0-9_-]{1,60}$"},
            "version": {"type": "integer", "minimum": 0, "maximum": VERSION},
            "text": {"type": "string"},
            "turbine": {"anyOf": [{"type": "string"}, turbine]},
            "rig": {"anyOf": [{"type": "string"}, rig]},
            "site": {"anyOf": [{"type": "string"}, site]},
            "world": world,
            "parameters": {"type": "object"},
            "limits": limits,
            "initial": {"type": "string"},
            "on": {"$ref": "#/$defs/on"},
            "states": {"$ref": "#/$defs/states"},
            "never": statements,
            "always_eventually": statements,
        },
        mission_in.FIELDS,
    )
    whole = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A mission",
        **_object(properties),
        "anyOf": [{"required": ["mission", "version", "initial", "states"]}, *_composed()],
        "$defs": dict(sorted(definitions.items())),
    }
    return dict(_overlay(whole))


def _object(properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _described(properties: dict[str, Any], texts: dict[str, str]) -> dict[str, Any]:
    """Each property with its documentation; the table of the loader and this one must name the same keys."""
    assert properties.keys() == texts.keys(), properties.keys() ^ texts.keys()
    return {key: {**value, "description": texts[key]} for key, value in properties.items()}


def _composed() -> list[dict[str, Any]]:
    return [{"required": [key]} for key in _COMPOSING]


def _overlay(node: dict[str, Any]) -> dict[str, Any]:
    """The same schema for files that are laid over others: any mapping may take what it lacks from a file, a value may
    be a reference, and `~` removes what was inherited."""
    found: dict[str, Any] = {}
    for key, value in node.items():
        if key in _NESTED:
            found[key] = {name: _overlay(inner) for name, inner in value.items()}
        elif key in _LISTED:
            found[key] = [_overlay(inner) for inner in value]
        else:
            found[key] = _overlay(value) if key in _WRAPPED and isinstance(value, dict) else value
    if found.get("type") == "object" and "properties" in found:
        values = {name: _removable(value) for name, value in found["properties"].items()}
        found["properties"] = {**values, **_COMPOSING}
        if needed := found.pop("required", None):
            found["anyOf"] = [{"required": needed}, *_composed()]
    if found.get("type") == "object" and isinstance(found.get("additionalProperties"), dict):
        found["additionalProperties"] = _removable(found["additionalProperties"])
        found["properties"] = dict(_COMPOSING)
    return found


def _removable(value: dict[str, Any]) -> dict[str, Any]:
    """A value, a reference to one, or nothing; what is said about it stays outermost, where editors look."""
    said: dict[str, Any] = {key: value[key] for key in ("description", "default", "title", "examples") if key in value}
    own = {key: inner for key, inner in value.items() if key not in said}
    if not own or own == {"type": "object"}:
        return value
    return {**said, "anyOf": [own, _REFERENCE, {"type": "null"}]}


def _model(model: type[BaseModel], definitions: dict[str, Any]) -> dict[str, Any]:
    """A model's schema, its own definitions moved to the common ones."""
    own = model.model_json_schema(ref_template="#/$defs/{model}")
    definitions.update(own.pop("$defs", {}))
    return own
