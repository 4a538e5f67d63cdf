"""Scenario files: what happens to a mission, and where it must be then. Read with places.

mission: ../v80_blade.yaml
coverage: complete
scenarios:
  the blade is lost and found again:
    - at: inspect.blade.leading
    - vision_lost: inspect.reacquire
    - {event: reacquired, state: inspect.blade.leading, does: follow_edge}
    - {wait_s: 301, state: abort.back_off}
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mission.behaviours.behaviour import behaviours
from mission.executive.events import EVENTS, outcomes
from mission.language.diagnostics import Diagnostic, near_or_choices
from mission.language.document import OUTCOMES, Mission
from mission.language.loading import examine
from mission.language.location import Location
from mission.language.quantities import keys
from mission.language.scenario import Scenario, ScenarioFile, ScenarioStep
from mission.language.sources import Sources, mission_root, shown
from mission.language.tree import Entry, Items, Node, Scalar, Table, kind, plain

FIELDS = {
    "mission": "the mission file, seen from this file",
    "set": "overrides, as on the command line",
    "coverage": "complete: every state entered and every transition taken by these scenarios",
    "allow_untaken": "transitions that these scenarios need not take, as STATE:EVENT",
    "scenarios": "name → list of steps",
}
STEP = {
    "at": "begin in this state instead of the initial one; only as the first step",
    "event": "what happens; EVENT: STATE is the short form",
    "within": "the composite whose deadline is meant",
    "wait_s": "seconds that pass",
    "given": "quantities that guards read, from here on",
    "state": "where the mission must be then",
    "states": "all innermost states that must be entered in this step, in order",
    "does": "the behaviour that must run then",
    "with": "parameters that it must have been given",
    "outcome": "how the mission must have ended",
    "ignored": "true: nothing may answer the event",
    "delayed_s": "the transition must be delayed by so many seconds",
}

LONGEST_S = 86_400.0  # a day: longer than anything flies


def read(path: Path) -> tuple[ScenarioFile | None, tuple[Diagnostic, ...]]:
    """A scenario file, None with findings if it, or its mission, is wrong."""
    return _Reader(path).read()


class _Reader:
    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[Diagnostic] = []

    def read(self) -> tuple[ScenarioFile | None, tuple[Diagnostic, ...]]:
        sources = Sources(mission_root(self.path), self.problems)
        table = sources.read(self.path)
        if table is None:
            return None, tuple(self.problems)
        for key, entry in table.entries.items():
            if key not in FIELDS:
                self.report(entry.key, f"a scenario file has no {key!r}", near_or_choices(key, FIELDS))
        mission = self.mission(table)
        scenarios = self.scenarios(table)
        coverage = table.get("coverage")
        if coverage is not None and (not isinstance(coverage, Scalar) or coverage.value != "complete"):
            self.report(coverage.location, f"coverage can be asked to be complete, not {kind(coverage)}")
        if mission is not None:
            for step in (step for scenario in scenarios for step in scenario.steps):
                self.names(step, mission)
        if mission is None or self.problems:
            return None, tuple(self.problems)
        untaken = tuple(text for text, _ in self.texts(table, "allow_untaken"))
        place = table.key_location("coverage")
        return ScenarioFile(self.path, mission, scenarios, coverage is not None, untaken, place), ()

    def mission(self, table: Table) -> Mission | None:
        name = table.get("mission")
        if not isinstance(name, Scalar) or not isinstance(name.value, str):
            self.report(table.key_location("mission"), "`mission` must name the mission file")
            return None
        overrides = [text for text, _ in self.texts(table, "set")]
        path = Path(name.location.file).parent / name.value
        if not path.is_file():
            self.report(name.location, f"the mission file {shown(path)} does not exist")
            return None
        examination = examine(path, overrides)
        self.problems.extend(examination.errors)
        return examination.mission

    def texts(self, table: Table, key: str) -> list[tuple[str, Location]]:
        node = table.get(key)
        nodes = node.items if isinstance(node, Items) else () if node is None else (node,)
        found = []
        for item in nodes:
            if isinstance(item, Scalar) and isinstance(item.value, str):
                found.append((item.value, item.location))
            else:
                self.report(item.location, f"{key} takes pieces of text, not {kind(item)}")
        return found

    def scenarios(self, table: Table) -> tuple[Scenario, ...]:
        node = table.get("scenarios")
        if not isinstance(node, Table) or not node.entries:
            self.report(table.key_location("scenarios"), "`scenarios` must map names to lists of steps")
            return ()
        return tuple(self.scenario(name, entry) for name, entry in node.entries.items())

    def scenario(self, name: str, entry: Entry) -> Scenario:
        steps: list[ScenarioStep] = []
        if not isinstance(entry.node, Items) or not entry.node.items:
            self.report(entry.node.location, f"{name!r} must be a list of steps")
        else:
            for number, item in enumerate(entry.node.items):
                step = self.step(item)
                if step is None:
                    continue
                if "at" in step.fields and number > 0:
                    self.report(step.places["at"], "only the first step can begin somewhere")
                steps.append(step)
        return Scenario(name, tuple(steps), entry.key)

    def step(self, node: Node) -> ScenarioStep | None:
        if not isinstance(node, Table):
            self.report(node.location, f"a step is a mapping, such as EVENT: STATE, not {kind(node)}")
            return None
        fields: dict[str, Any] = {}
        places: dict[str, Location] = {}
        others = [key for key in node.entries if key not in STEP]
        for key in others:
            entry = node.entries[key]
            if len(others) > 1 or "event" in node.entries or not isinstance(entry.node, Scalar):
                self.report(entry.key, f"a step has no {key!r}", near_or_choices(key, STEP))
                continue
            if key not in EVENTS and key not in outcomes():
                self.report(
                    entry.key, f"there is no event {key!r}", near_or_choices(key, [*EVENTS, *outcomes(), *STEP])
                )
                continue
            fields |= {"event": key, "state": entry.node.value}
            places |= {"event": entry.key, "state": entry.node.location}
        for key, entry in node.entries.items():
            if key in STEP:
                fields[key] = plain(entry.node)
                places[key] = entry.key
        self.types(fields, places)
        return ScenarioStep(fields, places, places.get("event", node.location))

    def types(self, fields: dict[str, Any], places: dict[str, Location]) -> None:
        wanted: dict[str, tuple[type, ...]] = {
            **dict.fromkeys(("at", "event", "within", "state", "does", "outcome"), (str,)),
            **dict.fromkeys(("wait_s", "delayed_s"), (int, float)),
            **dict.fromkeys(("given", "with"), (dict,)),
            "states": (list,),
            "ignored": (bool,),
        }
        for key, types in wanted.items():
            value = fields.get(key)
            if key in fields and (not isinstance(value, types) or (isinstance(value, bool) and bool not in types)):
                self.report(places[key], f"{key}: {STEP[key]}; not {value!r}")
                fields.pop(key)
            elif isinstance(value, int | float) and types == (int, float) and not 0 <= value <= LONGEST_S:
                self.report(places[key], f"{key}: {STEP[key]}; not {value:g}", f"0 to {LONGEST_S:g}")
                fields.pop(key)
        for name, value in fields.get("given", {}).items():
            if name not in keys():
                self.report(places["given"], f"there is no quantity {name!r}", near_or_choices(name, keys()))
            elif value is not None and not (isinstance(value, int | float) and abs(value) < float("inf")):
                self.report(places["given"], f"{name} is a number, true, false or null, not {value!r}")

    def names(self, step: ScenarioStep, mission: Mission) -> None:
        """Whether the mission has what the step speaks of; expecting what does not exist can only fail."""
        fields = step.fields
        for key in ("at", "within", "state", "states"):
            value = fields.get(key, [])
            for name in value if isinstance(value, list) else [value]:
                if name not in mission.states:
                    self.report(step.places[key], f"there is no state {name!r}", near_or_choices(name, mission.states))
        does = fields.get("does")
        behaviour = behaviours().get(does) if does is not None else None
        if does is not None and behaviour is None:
            self.report(step.places["does"], f"there is no behaviour {does!r}", near_or_choices(does, behaviours()))
        if (outcome := fields.get("outcome")) is not None and outcome not in OUTCOMES:
            self.report(step.places["outcome"], f"no mission ends {outcome!r}", near_or_choices(outcome, OUTCOMES))
        if behaviour is not None:
            known = behaviour.parameters.model_fields
            for name in (name for name in fields.get("with", {}) if name not in known):
                self.report(step.places["with"], f"{does} has no parameter {name!r}", near_or_choices(name, known))

    def report(self, place: Location, message: str, hint: str = "") -> None:
        self.problems.append(Diagnostic(place, "M501", message, hint))
