"""Statements that a mission makes about itself and that `mission prove` holds it to: `never:` and
`always_eventually:`."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal

from mission.language.conditions import Condition, ConditionError, parse
from mission.language.diagnostics import Diagnostic, near_or_choices
from mission.language.location import NOWHERE, Location
from mission.language.quantities import Quantity
from mission.language.tree import Items, Scalar, Table, kind

Kind = Literal["never", "always_eventually"]
KINDS: tuple[Kind, ...] = ("never", "always_eventually")


@dataclass(frozen=True)
class Invariant:
    """never: no reachable situation makes the statement true. always_eventually: from every reachable situation,
    whatever happens, one that makes it true is reached."""

    kind: Kind
    statement: Condition
    location: Location = NOWHERE


FLAGS = (
    Quantity("airborne", "", "the vehicle may be in the air"),
    Quantity("armed", "", "the motors may be running; as airborne, and while taking off and landing"),
    Quantity("laser_on", "", "the behaviour that runs lights the laser"),
    Quantity("recording", "", "the behaviour that runs records the blade's side; single photographs do not count"),
    Quantity("needs_vision", "", "the behaviour that runs needs images"),
    Quantity("ended", "", "the mission has ended"),
)


def vocabulary(states: Collection[str]) -> Mapping[str, Quantity]:
    """What invariants may speak of: `in(state)` and the flags of a situation."""
    inside = Quantity("in", "", "the state, or one inside it, is active", arguments=tuple(states))
    return {inside.name: inside, **{flag.name: flag for flag in FLAGS}}


def read(root: Table, states: Collection[str], problems: list[Diagnostic]) -> tuple[Invariant, ...]:
    """The invariants of a mission document; those that cannot be understood are reported and left out."""
    words = vocabulary(states)
    found: list[Invariant] = []
    for what in KINDS:
        node = root.get(what)
        if node is None:
            continue
        for item in node.items if isinstance(node, Items) else (node,):
            if not isinstance(item, Scalar) or not isinstance(item.value, str):
                message = f"{what} takes a statement, as in in(abort) and laser_on, not {kind(item)}"
                problems.append(Diagnostic(item.location, "M203", message))
                continue
            try:
                found.append(Invariant(what, parse(item.value, words), item.location))
            except ConditionError as error:
                at = item.location
                place = Location(at.file, at.line, at.column + item.offset + error.column) if at.line else at
                hint = near_or_choices(error.unknown, error.known) if error.known else ""
                problems.append(Diagnostic(place, "M213", f"{what}: {error}", hint))
    return tuple(found)
