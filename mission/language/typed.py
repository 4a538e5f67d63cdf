"""Turns a part of the tree into a pydantic model, and pydantic's findings into ones with a place and a remedy."""

from __future__ import annotations

import json
import re
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from mission.language.diagnostics import Diagnostic, near_or_choices
from mission.language.location import Location
from mission.language.tree import Node, Scalar, Table, descend, kind, plain

M = TypeVar("M", bound=BaseModel)

_OUTSIDE = ("greater_than", "less_than", "too_long", "too_short", "pattern", "literal", "enum", "finite", "multiple")


def typed(model: type[M], node: Node, place: Location, what: str, problems: list[Diagnostic]) -> M | None:
    """The node as a model, None with findings in `problems`.

    place: where the section begins, for what is missing in it. what: its name in messages.
    """
    if not isinstance(node, Table):
        hint = near_or_choices("", model.model_fields)
        problems.append(Diagnostic(node.location, "M203", f"{what} must be a mapping, not {kind(node)}", hint))
        return None
    try:
        # JSON is pydantic's strict input that still knows lists for tuples: no "3" for 3, no true for 1.
        return model.model_validate_json(json.dumps(plain(node)), strict=True)
    except ValidationError as error:
        problems.extend(_finding(model, node, place, what, detail) for detail in error.errors(include_url=False))
        return None


def _finding(model: type[BaseModel], root: Table, place: Location, what: str, detail: ErrorDetails) -> Diagnostic:
    path = list(detail["loc"])
    kind_of_error = detail["type"]
    label = ".".join(str(step) for step in path) or what
    if kind_of_error == "missing":
        # Steps that pydantic adds for unions are no keys; the place is the nearest mapping around.
        outer, location = descend(root, path[:-1])
        location = place if outer is root else location
        if isinstance(path[-1], int):
            return Diagnostic(location, "M203", f"{_inside(what, path[:-1])} has {path[-1]} values, too few")
        return Diagnostic(location, "M201", f"{_inside(what, path[:-1])} needs {path[-1]!r}{_meaning(model, path)}")
    node, location = descend(root, path)
    used = f"; used at {node.used_at}" if isinstance(node, Scalar) and node.used_at else ""
    if not isinstance(node, Table) or node.location.file != location.file or node.location < location:
        location = node.location  # for a mapping its key, unless a reference put it there
    if kind_of_error == "extra_forbidden":
        _, location = descend(root, path)
        known = _fields(model, path[:-1])
        hint = near_or_choices(str(path[-1]), known) if known else "nothing can be said here"
        return Diagnostic(location, "M202", f"{_inside(what, path[:-1])} has no {path[-1]!r}{used}", hint)
    message = detail["msg"]
    if kind_of_error == "value_error":
        message = message.removeprefix("Value error, ")
        _, location = descend(root, path)
        return Diagnostic(_culprit(node, message) or (place if not path else location), "M205", f"{label}: {message}")
    code = "M204" if any(word in kind_of_error for word in _OUTSIDE) else "M203"
    given = f", not {kind(node)}" if code == "M203" else f", not {_value(node)}"
    return Diagnostic(location, code, f"{label}: {_lower(message)}{given}{used}", _meaning(model, path).strip(" ()"))


def _value(node: Node) -> str:
    """What is given, where its type is right."""
    if isinstance(node, Scalar) and isinstance(node.value, int | float) and not isinstance(node.value, bool):
        return f"{node.value:g}"
    return kind(node).removeprefix("the ").removeprefix("text ")


def _culprit(node: Node, message: str) -> Location | None:
    """The first key named in the message that the mapping really has."""
    if isinstance(node, Table):
        for word in re.findall(r"\w+", message):
            if word in node.entries:
                return node.entries[word].key
    return None


def _inside(what: str, path: list[str | int]) -> str:
    return ".".join([what, *(str(step) for step in path)])


def _lower(message: str) -> str:
    message = message.removeprefix("Input should be ")
    return f"must be {message}" if message[:1].islower() else message[:1].lower() + message[1:]


def _model_at(model: type[BaseModel], path: list[str | int]) -> type[BaseModel] | None:
    """The model of the section that a path leads to."""
    current: type[BaseModel] | None = model
    for step in path:
        field = current.model_fields.get(str(step)) if current else None
        current = _model_in(field.annotation) if field else None
    return current


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        if found := _model_in(argument):
            return found
    return None


def _fields(model: type[BaseModel], path: list[str | int]) -> list[str]:
    inner = _model_at(model, path)
    return list(inner.model_fields) if inner else []


def _meaning(model: type[BaseModel], path: list[str | int]) -> str:
    """What a field is for, from its documentation."""
    if not path:
        return ""
    inner = _model_at(model, path[:-1])
    field = inner.model_fields.get(str(path[-1])) if inner else None
    return f" ({field.description.rstrip('.')})" if field is not None and field.description else ""
