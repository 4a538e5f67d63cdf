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
    events = {name: event.text for name, event in {**EVENTS, **outcomes()}.items()}
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
            "timeout_s": _or_reference({"type": "number", "exclusiveMinimum": 0}),
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
    state["include"] = {**_FILES, "description": "files whose state this one is laid over"}
    definitions["state"] = _object(state) | {
        "allOf": [
            {
                "if": {"properties": {"do": {"const": name}}, "required": ["do"]},
                "then": {"properties": {"with": _model(behaviour.parameters, definitions, references=True)}},
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
    properties["extends"] = {**_FILES, "description": "missions that this one is laid over"}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A mission",
        **_object(properties),
        "anyOf": [{"required": ["mission", "version", "initial", "states"]}, {"required": ["extends"]}],
        "$defs": dict(sorted(definitions.items())),
    }


def _object(properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": properties, "additionalProperties": False}


def _described(properties: dict[str, Any], texts: dict[str, str]) -> dict[str, Any]:
    """Each property with its documentation; the table of the loader and this one must name the same keys."""
    assert properties.keys() == texts.keys(), properties.keys() ^ texts.keys()
    return {key: {**value, "description": texts[key]} for key, value in properties.items()}


def _or_reference(value: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [value, _REFERENCE]}


def _model(model: type[BaseModel], definitions: dict[str, Any], references: bool = False) -> dict[str, Any]:
    """A model's schema, its own definitions moved to the common ones."""
    own = model.model_json_schema(ref_template="#/$defs/{model}")
    definitions.update(own.pop("$defs", {}))
    if references:
        own["properties"] = {name: _or_reference(value) for name, value in own.get("properties", {}).items()}
    return own
