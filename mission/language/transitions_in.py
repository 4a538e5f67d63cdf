"""Reads `on:` of a state: events and what they lead to."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from mission.language.conditions import Condition, ConditionError, parse
from mission.language.diagnostics import Diagnostic, choices, near_or_choices, suggestion
from mission.language.document import History, Transition, enclosing
from mission.language.location import Location
from mission.language.shapes import no_answers
from mission.language.tree import Items, Node, Scalar, Table, kind

FIELDS = {
    "to": "the state to enter",
    "when": "a condition that must hold",
    "unless": "a condition that must not hold",
    "after_s": "seconds between the event and the transition",
    "retries": "how often it may be taken in a run",
    "backoff_s": "wait before taking it again, doubled each time",
    "history": "enter the target where it was left: shallow or deep",
    "confirm": "ask the operator first, with autonomy confirm",
}
_MOST_S = 86400.0


class TransitionReader:
    """Reads transitions of one mission: knows its states and the events that exist."""

    def __init__(
        self, states: Collection[str], composites: Collection[str], events: Collection[str], problems: list[Diagnostic]
    ) -> None:
        self.states = states
        self.composites = composites
        self.events = events
        self.problems = problems

    def read(self, node: Node, source: str) -> tuple[Transition, ...]:
        """All transitions under one `on:`; what is wrong is reported and left out."""
        if not isinstance(node, Table):
            self.problems.append(no_answers(node))
            return ()
        found: list[Transition] = []
        for event, entry in node.entries.items():
            if event not in self.events:
                self.report(entry.key, "M211", f"there is no event {event!r}", near_or_choices(event, self.events))
            nodes = entry.node.items if isinstance(entry.node, Items) else (entry.node,)
            if not nodes:
                self.report(entry.key, "M203", f"{event!r} leads nowhere: the list is empty")
            for index, one in enumerate(nodes):
                transition = self.one(event, one, source, index, entry.key if index == 0 else one.location)
                if transition is not None:
                    found.append(transition)
        return tuple(found)

    def one(self, event: str, node: Node, source: str, index: int, place: Location) -> Transition | None:
        if isinstance(node, Scalar):
            target = self.target(node, source)
            return Transition(event, target, source, index=index, location=place) if target is not None else None
        if not isinstance(node, Table):
            self.report(node.location, "M203", "a transition is a state's name or a mapping with `to`, not a list")
            return None
        self.unknown_keys(node)
        to = node.get("to")
        if to is None:
            self.report(place, "M201", f"the transition on {event!r} needs `to`: the state to enter")
            return None
        target = self.target(to, source)
        history = self.history(node, target)
        retries = self.whole(node, "retries", 1, 1000)
        backoff_s = self.number(node, "backoff_s", 0.0, 3600.0)
        if backoff_s and retries is None:
            self.report(node.key_location("backoff_s"), "M205", "backoff_s belongs to retries, which is not given")
        after_s = self.number(node, "after_s", 0.0, _MOST_S)
        when, unless = self.condition(node, "when"), self.condition(node, "unless")
        confirm = self.flag(node, "confirm")
        if target is None:
            return None
        return Transition(
            event, target, source, when, unless, after_s, retries, backoff_s or 0.0, history, confirm, index, place
        )

    def target(self, node: Node, source: str) -> str | None:
        """The absolute path of a target: children of a composite, then siblings, then names further out."""
        if not isinstance(node, Scalar) or not isinstance(node.value, str) or not node.value:
            self.report(node.location, "M203", f"a state's name is expected, not {kind(node)}")
            return None
        for scope in scopes(source, source in self.composites):
            path = f"{scope}.{node.value}" if scope else node.value
            if path in self.states:
                return path
        used = f"; used at {node.used_at}" if node.used_at else ""
        visible = {name for scope in scopes(source, source in self.composites) for name in self.inside(scope)}
        hint = suggestion(node.value, visible) or suggestion(node.value, self.states) or choices(visible)
        self.report(node.location, "M212", f"there is no state {node.value!r} to go to{used}", hint)
        return None

    def inside(self, scope: str) -> Iterator[str]:
        """Names of the states directly inside a scope."""
        for path in self.states:
            parent, _, name = path.rpartition(".")
            if parent == scope:
                yield name

    def unknown_keys(self, node: Table) -> None:
        for key, entry in node.entries.items():
            if key not in FIELDS:
                self.report(entry.key, "M202", f"a transition has no {key!r}", near_or_choices(key, FIELDS))

    def history(self, node: Table, target: str | None) -> History | None:
        value = node.get("history")
        if value is None:
            return None
        if not isinstance(value, Scalar) or value.value not in ("shallow", "deep"):
            self.report(value.location, "M204", f"history is shallow or deep, not {kind(value)}")
            return None
        if target is not None and target not in self.composites:
            self.report(
                node.key_location("history"), "M215", f"{target!r} has no states inside whose history could be entered"
            )
        return "deep" if value.value == "deep" else "shallow"

    def number(self, node: Table, key: str, low: float, high: float) -> float | None:
        return read_number(node, key, low, high, self.problems)

    def whole(self, node: Table, key: str, low: int, high: int) -> int | None:
        value = read_number(node, key, low, high, self.problems)
        if value is not None and value != int(value):
            self.report(node.key_location(key), "M203", f"{key} is a whole number, not {value:g}")
        return int(value) if value is not None else None

    def flag(self, node: Table, key: str) -> bool:
        return read_flag(node, key, self.problems)

    def condition(self, node: Table, key: str) -> Condition | None:
        value = node.get(key)
        if value is None:
            return None
        if not isinstance(value, Scalar) or not isinstance(value.value, str):
            self.report(
                value.location, "M213", f"{key} takes a condition, as in battery_percent > 40, not {kind(value)}"
            )
            return None
        try:
            return parse(value.value)
        except ConditionError as error:
            at = value.location
            place = Location(at.file, at.line, at.column + value.offset + error.column) if at.line else at
            hint = near_or_choices(error.unknown, error.known) if error.known else ""
            self.report(place, "M213", f"{key}: {error}", hint)
            return None

    def report(self, place: Location, code: str, message: str, hint: str = "") -> None:
        self.problems.append(Diagnostic(place, code, message, hint))


def scopes(source: str, composite: bool) -> tuple[str, ...]:
    """Paths under which a target's name is looked up, nearest first; "" is the mission itself."""
    around = tuple(enclosing(source))
    return (*(around if composite or not source else around[1:]), "")


def read_number(node: Table, key: str, low: float, high: float, problems: list[Diagnostic]) -> float | None:
    """A number within limits, None where it is absent or wrong."""
    value = node.get(key)
    if value is None:
        return None
    if not isinstance(value, Scalar) or isinstance(value.value, bool) or not isinstance(value.value, int | float):
        problems.append(Diagnostic(value.location, "M203", f"{key} is a number, not {kind(value)}"))
        return None
    if not low <= value.value <= high:
        used = f"; used at {value.used_at}" if value.used_at else ""
        problems.append(
            Diagnostic(value.location, "M204", f"{key} must be between {low:g} and {high:g}, not {value.value:g}{used}")
        )
        return None
    return float(value.value)


def read_flag(node: Table, key: str, problems: list[Diagnostic]) -> bool:
    """true or false; false where it is absent or wrong."""
    value = node.get(key)
    if value is None:
        return False
    if not isinstance(value, Scalar) or not isinstance(value.value, bool):
        problems.append(Diagnostic(value.location, "M203", f"{key} is true or false, not {kind(value)}"))
        return False
    return value.value
