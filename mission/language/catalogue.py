"""The words of the language with their documentation, collected from where the code declares them."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pydantic import BaseModel


@dataclass(frozen=True)
class Word:
    """One word: its name, what it means in a line, and its parts as (name, kind and limits, meaning)."""

    name: str
    text: str
    facts: tuple[str, ...] = ()
    parts: tuple[tuple[str, str, str], ...] = field(default=())

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        parts = [{"name": name, "type": kind, "text": text} for name, kind, text in self.parts]
        return {"name": self.name, "text": self.text, "facts": list(self.facts), "parts": parts}


def catalogue(what: str) -> tuple[Word, ...]:
    """All words of one sort: behaviours, events, conditions, invariants, monitors, limits or codes."""
    return tuple(_SORTS[what]())


def shown(words: Iterable[Word], width: int = 110) -> str:
    """The words as text for a terminal."""
    lines: list[str] = []
    for word in words:
        facts = f"  ({'; '.join(word.facts)})" if word.facts else ""
        lines.append(f"{word.name}{facts}")
        lines += textwrap.wrap(" ".join(word.text.split()), width, initial_indent="    ", subsequent_indent="    ")
        column = max((len(name) + len(kind) for name, kind, _ in word.parts), default=0) + 6
        for name, kind, text in word.parts:
            head = f"    {name}  {kind}".ljust(column + 4)
            lines += textwrap.wrap(head + text, width, subsequent_indent=" " * (column + 4), drop_whitespace=True)
        lines.append("")
    return "\n".join(lines).rstrip()


def _behaviours() -> Iterable[Word]:
    from mission.behaviours.behaviour import behaviours

    for behaviour in behaviours().values():
        where = {True: "in the air", False: "on the ground", None: ""}[behaviour.airborne]
        facts = tuple(fact for fact in (where, "needs images" if behaviour.needs_vision else "") if fact)
        outcomes = tuple((f"→ {name}", "", text) for name, text in behaviour.outcomes.items())
        yield Word(behaviour.name, behaviour.text, facts, _fields(behaviour.parameters) + outcomes)


def _events() -> Iterable[Word]:
    from mission.behaviours.behaviour import behaviours
    from mission.executive.events import EVENTS, outcomes

    for event in EVENTS.values():
        falls = f"falls back to {event.falls_back_to}" if event.falls_back_to else ""
        facts = (str(event.severity), f"raised by {event.raised_by}", falls)
        yield Word(event.name, event.text, tuple(fact for fact in facts if fact))
    for name in sorted(outcomes()):
        ends = [(one.name, "", one.outcomes[name]) for one in behaviours().values() if name in one.outcomes]
        yield Word(
            name, f"how {', '.join(one for one, _, _ in ends)} can end", ("outcome of a behaviour",), tuple(ends)
        )


def _conditions() -> Iterable[Word]:
    from mission.language.quantities import QUANTITIES

    for quantity in QUANTITIES.values():
        if quantity.is_condition:
            asked = tuple(f"{quantity.name}({argument})" for argument in quantity.arguments)
            yield Word(quantity.name, quantity.text, asked or ("yes or no",))
        else:
            yield Word(quantity.name, quantity.text, (f"{quantity.low:g} to {quantity.high:g} {quantity.unit}",))


def _invariants() -> Iterable[Word]:
    from mission.language.invariants import KINDS, Invariant, vocabulary

    meanings = " ".join((Invariant.__doc__ or "").split())
    for kind in KINDS:
        meaning = meanings.partition(f"{kind}: ")[2].partition(". ")[0]
        yield Word(kind, meaning.rstrip(".") + ".", ("a statement, or a list of them",))
    for quantity in vocabulary(("STATE",)).values():
        asked = tuple(f"{quantity.name}({argument})" for argument in quantity.arguments)
        yield Word(quantity.name, quantity.text, asked or ("yes or no",))


def _monitors() -> Iterable[Word]:
    from mission.executive.events import EVENTS
    from mission.language.limits import Limits

    for event in EVENTS.values():
        if event.raised_by == "monitor":
            limits = tuple(f"limits.{name}" for name in Limits.model_fields if f"limits.{name}" in event.text)
            yield Word(event.name, event.text, (str(event.severity), *limits))


def _limits() -> Iterable[Word]:
    from mission.language.limits import Limits

    for name, kind, text in _fields(Limits):
        yield Word(f"limits.{name}", text, (kind,))


def _codes() -> Iterable[Word]:
    from mission.language.codes import CODES

    for code in CODES.values():
        facts = (str(code.level), "may be silenced by `# allow:`") if code.allowed else (str(code.level),)
        yield Word(code.name, code.text, facts)


def _fields(model: type[BaseModel]) -> tuple[tuple[str, str, str], ...]:
    """Fields of a model: name, type with limits and default, meaning."""
    properties = model.model_json_schema().get("properties", {})
    return tuple((name, _kind(schema), str(schema.get("description", ""))) for name, schema in properties.items())


def _kind(schema: Mapping[str, Any]) -> str:
    options = schema.get("anyOf", [schema])
    kinds = [_one_kind(option) for option in options if option.get("type") != "null"]
    default = schema.get("default")
    shown_default = f", {default} unless said" if default is not None else "" if "default" in schema else ", needed"
    return " or ".join(kinds) + shown_default


def _one_kind(schema: Mapping[str, Any]) -> str:
    if "enum" in schema:
        return " | ".join(str(value) for value in schema["enum"])
    if "const" in schema:
        return str(schema["const"])
    kind = {"number": "number", "integer": "whole number", "boolean": "true or false", "string": "text"}.get(
        schema.get("type", ""), "list" if schema.get("type") == "array" else "mapping"
    )
    low, high = (
        schema.get("minimum", schema.get("exclusiveMinimum")),
        schema.get("maximum", schema.get("exclusiveMaximum")),
    )
    return f"{kind} {low:g} to {high:g}" if low is not None and high is not None else kind


_SORTS: Mapping[str, Callable[[], Iterable[Word]]] = {
    "behaviours": _behaviours,
    "events": _events,
    "conditions": _conditions,
    "invariants": _invariants,
    "monitors": _monitors,
    "limits": _limits,
    "codes": _codes,
}
