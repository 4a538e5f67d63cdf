"""Reads `states:`: the tree of states with their behaviours, parameters, deadlines and transitions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from mission.behaviours.behaviour import Behaviour, NoParameters, Parameters
from mission.language.diagnostics import Diagnostic, near_or_choices
from mission.language.document import OUTCOMES, State, enclosing
from mission.language.limits import Limits
from mission.language.location import Location
from mission.language.shapes import mistaken_for, no_state
from mission.language.transitions_in import TransitionReader, read_flag, read_number
from mission.language.tree import Node, Scalar, Table, kind, merge
from mission.language.typed import typed

FIELDS = {
    "do": "the behaviour that runs while the state is active",
    "with": "its parameters",
    "timeout_s": "deadline: then timed_out is raised",
    "on": "events and what they lead to",
    "initial": "the state inside that is entered first",
    "states": "states inside this one",
    "final": "true: the mission ends here",
    "outcome": "how it ended: completed, aborted, refused or released",
    "limits": "limits of the monitors in this state and all inside",
    "entry": "true: the operator may skip to this state",
    "text": "what the state is for, for people",
    "parameters": "values that ${name} refers to in this state and all inside",
}
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_LONGEST_TIMEOUT_S = 86400.0
_MOST_STATES = 1000


@dataclass(frozen=True)
class _Found:
    """A state's own text before it is understood."""

    path: str
    parent: str | None
    table: Table
    place: Location
    children: tuple[str, ...]


class StatesReader:
    """Reads all states of a mission."""

    def __init__(
        self, behaviours: Mapping[str, Behaviour], events: frozenset[str], limits: Table, problems: list[Diagnostic]
    ) -> None:
        self.behaviours = behaviours
        self.events = events
        self.limits = limits
        self.problems = problems
        self.found: dict[str, _Found] = {}
        self.guessed: set[str] = set()

    def read(self, states: Node) -> dict[str, State]:
        """Path → state, in file order, outer states before those inside."""
        self.collect(states, None)
        reader = self.transition_reader()
        return {path: self.state(found, reader) for path, found in self.found.items()}

    def unnamed(self, states: Mapping[str, State], named: Iterable[str]) -> None:
        """Report states that nothing names, where something names a state that does not exist: the typo may be either.

        named: paths that the mission's own `initial` and `on` lead to.
        """
        if not any(finding.code == "M212" for finding in self.problems):
            return
        ways = [("", target) for target in named]
        ways += [(path, transition.target) for path, state in states.items() for transition in state.on]
        ways += [(path, state.initial) for path, state in states.items() if state.initial and path not in self.guessed]
        # What leads into a state from within does not count for the state itself.
        reached = {path for source, target in ways for path in enclosing(target) if path not in enclosing(source)}
        reached |= {target for _, target in ways}
        for path, state in states.items():
            if path not in reached and not state.entry:
                self.report(state.location, "M301", f"nothing names the state {path!r}", mistaken_for(path, self.found))

    def transition_reader(self) -> TransitionReader:
        """Reads transitions among the states that were found."""
        composites = {path for path, found in self.found.items() if found.children}
        return TransitionReader(self.found, composites, self.events, self.problems)

    def initial(self, table: Table, scope: str, place: Location) -> str | None:
        """The absolute path of `initial` in a composite, or in the mission itself (scope "")."""
        what = f"the state {scope!r}" if scope else "the mission"
        children = [path for path, found in self.found.items() if (found.parent or "") == scope]
        names = [path.rpartition(".")[2] for path in children]
        node = table.get("initial")
        self.guessed.add(scope)
        if node is None:
            self.report(place, "M201", f"{what} needs `initial`: the state inside that is entered first")
            return children[0] if children else None
        if not isinstance(node, Scalar) or not isinstance(node.value, str):
            self.report(node.location, "M203", f"initial is a state's name, not {kind(node)}")
            return children[0] if children else None
        path = f"{scope}.{node.value}" if scope else node.value
        if path not in self.found:
            hint = near_or_choices(node.value, names)
            self.report(node.location, "M212", f"initial: there is no state {node.value!r} in {what}", hint)
            return children[0] if children else None
        self.guessed.discard(scope)
        return path

    def collect(self, node: Node, parent: str | None) -> tuple[str, ...]:
        if not isinstance(node, Table):
            self.report(node.location, "M203", f"states must map names to states, not {kind(node)}")
            return ()
        paths: list[str] = []
        for name, entry in node.entries.items():
            if not _NAME.fullmatch(name):
                self.report(entry.key, "M207", f"{name!r} cannot name a state", "letters, digits and _, at most 40")
                continue
            if not isinstance(entry.node, Table):
                self.problems.append(no_state(name, entry.node))
                continue
            path = f"{parent}.{name}" if parent else name
            paths.append(path)
            if len(self.found) >= _MOST_STATES:
                self.report(entry.key, "M006", f"a mission may have {_MOST_STATES} states at most")
                break
            found = self.found[path] = _Found(path, parent, entry.node, entry.origin, ())
            if (inner := found.table.get("states")) is not None:
                self.found[path] = replace(found, children=self.collect(inner, path))
        return tuple(paths)

    def state(self, found: _Found, reader: TransitionReader) -> State:
        table, path = found.table, found.path
        for key, entry in table.entries.items():
            if key not in FIELDS:
                self.report(entry.key, "M202", f"a state has no {key!r}", near_or_choices(key, FIELDS))
        on, final = table.get("on"), self.final(found)
        self.one_kind(found, final)
        return State(
            path=path,
            parent=found.parent,
            do=self.do(table),
            parameters=self.parameters(found),
            timeout_s=self.timeout_s(table),
            on=reader.read(on, path) if on is not None else (),
            initial=self.initial(table, path, found.place) if found.children else None,
            children=found.children,
            final=final,
            limits=self.merged_limits(found),
            entry=read_flag(table, "entry", self.problems),
            text=self.text(table),
            location=found.place,
        )

    def final(self, found: _Found) -> str | None:
        table = found.table
        final = read_flag(table, "final", self.problems)
        node = table.get("outcome")
        if node is None:
            if final:
                self.report(found.place, "M201", "a final state needs `outcome`", f"one of {', '.join(OUTCOMES)}")
                return OUTCOMES[1]
            return None
        if not final:
            self.report(table.key_location("outcome"), "M214", "only a final state has an outcome", "add final: true")
        value = node.value if isinstance(node, Scalar) else None
        if value not in OUTCOMES:
            hint = near_or_choices(str(value), OUTCOMES)
            self.report(node.location, "M204", f"outcome is one of {', '.join(OUTCOMES)}, not {kind(node)}", hint)
            value = OUTCOMES[1]
        return str(value) if final else None

    def one_kind(self, found: _Found, final: str | None) -> None:
        table, path = found.table, found.path
        if final is not None:
            for key in ("do", "with", "states", "initial", "on", "timeout_s"):
                if key in table.entries:
                    self.report(table.key_location(key), "M214", f"a final state has no {key!r}: the mission ends here")
        elif "states" in table.entries:
            for key in ("do", "with"):
                if key in table.entries:
                    message = f"a state with states inside has no {key!r}: only innermost states do something"
                    self.report(table.key_location(key), "M214", message)
            inner = table.get("states")
            if isinstance(inner, Table) and not inner.entries:
                self.report(table.key_location("states"), "M214", "there is no state inside")
        elif "initial" in table.entries:
            self.report(table.key_location("initial"), "M214", "initial belongs to a state with states inside")
        if final is None and "with" in table.entries and "do" not in table.entries and "states" not in table.entries:
            message = f"the state {path!r} has parameters, but no `do` that takes them"
            self.report(found.place, "M214", message, mistaken_for(path, self.found))

    def do(self, table: Table) -> str | None:
        node = table.get("do")
        if node is None:
            return None
        if not isinstance(node, Scalar) or not isinstance(node.value, str):
            self.report(node.location, "M203", f"do is a behaviour's name, not {kind(node)}")
            return None
        if node.value not in self.behaviours:
            hint = near_or_choices(node.value, self.behaviours)
            self.report(node.location, "M210", f"there is no behaviour {node.value!r}", hint)
            return None
        return node.value

    def parameters(self, found: _Found) -> Parameters | None:
        name = found.table.text("do")
        if name is None or name not in self.behaviours:
            return None
        given = found.table.get("with")
        place = found.table.key_location("with") if given is not None else found.table.key_location("do")
        model = self.behaviours[name].parameters
        if given is not None and isinstance(given, Table) and given.entries and model is NoParameters:
            self.report(place, "M202", f"{name} takes no parameters", "remove `with`")
            return None
        return typed(model, given if given is not None else Table({}, place), place, name, self.problems)

    def timeout_s(self, table: Table) -> float | None:
        value = read_number(table, "timeout_s", 0.0, _LONGEST_TIMEOUT_S, self.problems)
        if value == 0.0:
            self.report(table.key_location("timeout_s"), "M204", "timeout_s must be above 0")
        return value

    def merged_limits(self, found: _Found) -> Limits | None:
        """The limits that hold in the state: its own over those around it, the mission's outermost."""
        chain = [found]
        while (outer := chain[-1].parent) is not None:
            chain.append(self.found[outer])
        merged = self.limits
        for state in reversed(chain):
            own = state.table.get("limits")
            if isinstance(own, Table):
                merged = merge(merged, own)
        own = found.table.get("limits")
        if own is None:
            return typed(Limits, merged, found.place, "limits", [])
        if not isinstance(own, Table):
            self.report(own.location, "M203", f"limits must be a mapping, not {kind(own)}")
            return None
        return typed(Limits, merged, found.table.key_location("limits"), "limits", self.problems)

    def text(self, table: Table) -> str:
        node = table.get("text")
        if node is not None and (not isinstance(node, Scalar) or not isinstance(node.value, str)):
            self.report(node.location, "M203", f"text is for people: a sentence, not {kind(node)}")
        return table.text("text") or ""

    def report(self, place: Location, code: str, message: str, hint: str = "") -> None:
        self.problems.append(Diagnostic(place, code, message, hint))
