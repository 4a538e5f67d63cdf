"""Scenarios: what happens to a mission, and where it must be then; run on the simulated clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mission.language.diagnostics import Diagnostic
from mission.language.document import Mission
from mission.language.location import Location
from mission.language.simulation import Simulation, SimulationError
from mission.language.sources import shown


@dataclass(frozen=True)
class ScenarioStep:
    """One step: what happens and what must be true then."""

    fields: dict[str, Any]
    places: dict[str, Location]
    location: Location


@dataclass(frozen=True)
class Scenario:
    """One story."""

    name: str
    steps: tuple[ScenarioStep, ...]
    location: Location


@dataclass(frozen=True)
class Coverage:
    """States entered and transitions taken, of all there are."""

    states: tuple[int, int]
    transitions: tuple[int, int]
    missing_states: tuple[str, ...] = ()
    missing_transitions: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether nothing is missing."""
        return not self.missing_states and not self.missing_transitions


@dataclass(frozen=True)
class Result:
    """One scenario's end: what went wrong (nothing, where it passed) and where it went."""

    scenario: Scenario
    failure: Diagnostic | None
    entered: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()


@dataclass(frozen=True)
class ScenarioFile:
    """A file of scenarios that could be read, with its mission."""

    path: Path
    mission: Mission
    scenarios: tuple[Scenario, ...]
    must_be_complete: bool = False
    allow_untaken: tuple[str, ...] = ()
    location: Location = field(default=Location("", 0, 0))

    def run(self) -> tuple[Result, ...]:
        """Every scenario."""
        return tuple(run(self.mission, scenario) for scenario in self.scenarios)

    def coverage(self, results: Sequence[Result]) -> Coverage:
        """What these results have gone through."""
        entered = {path for result in results for path in result.entered}
        taken = {key for result in results for key in result.taken}
        states = tuple(self.mission.states)
        wanted = [
            transition
            for transition in self.mission.transitions()
            if f"{transition.source}:{transition.event}" not in self.allow_untaken
        ]
        return Coverage(
            (len(entered & set(states)), len(states)),
            (sum(transition.key in taken for transition in wanted), len(wanted)),
            tuple(path for path in states if path not in entered),
            tuple(
                f"{transition.source or 'the mission'}: {transition.event} → {transition.target}"
                f" ({transition.location.seen_from(shown(self.mission.path))})"
                for transition in wanted
                if transition.key not in taken
            ),
        )


def run(mission: Mission, scenario: Scenario) -> Result:
    """One scenario from its beginning to its end or to the first step that does not go as expected."""
    simulation: Simulation | None = None
    failure: Diagnostic | None = None
    for step in scenario.steps:
        try:
            if simulation is None:
                simulation = Simulation(mission, step.fields.get("at"))
            failure = _carried_out(simulation, step)
        except SimulationError as error:
            failure = Diagnostic(step.location, "M502", str(error))
        if failure is not None:
            break
    entered = tuple(simulation.entered) if simulation is not None else ()
    return Result(scenario, failure, entered, tuple(simulation.taken) if simulation is not None else ())


def _carried_out(simulation: Simulation, step: ScenarioStep) -> Diagnostic | None:
    fields = step.fields
    before = len(simulation.happenings)
    if "given" in fields:
        simulation.quantities |= fields["given"]
    if "wait_s" in fields:
        simulation.wait(fields["wait_s"])
    if "event" in fields:
        simulation.happens(fields["event"], within=fields.get("within"))
    happened = simulation.happenings[before:]
    steps = [one.step for one in happened if one.step is not None]
    last = happened[-1] if happened else None
    parameters = simulation.parameters
    wrong_parameters = {
        name: parameters.get(name) for name, value in fields.get("with", {}).items() if parameters.get(name) != value
    }
    expectations: list[tuple[str, bool, object]] = [
        ("state", simulation.state == fields.get("state"), simulation.state),
        ("states", [s.after.leaf for s in steps] == fields.get("states"), [s.after.leaf for s in steps]),
        ("does", simulation.does == fields.get("does"), simulation.does),
        ("with", not wrong_parameters, wrong_parameters),
        ("outcome", simulation.outcome == fields.get("outcome"), simulation.outcome),
        ("ignored", (not steps and not _delay(last)) == fields.get("ignored"), bool(not steps)),
        ("delayed_s", _delay(last) == fields.get("delayed_s"), _delay(last)),
    ]
    for name, fulfilled, found in expectations:
        if name in fields and not fulfilled:
            why = f"after {fields['event']!r}: " if "event" in fields else ""
            message = f"{why}{name} is {found!r}, not {fields[name]!r}, at {simulation.now_s:g} s"
            return Diagnostic(step.places.get(name, step.location), "M502", message)
    return None


def _delay(happening: Any) -> float:
    return float(happening.delayed_s) if happening is not None else 0.0


def coverage_finding(file: ScenarioFile, coverage: Coverage) -> Diagnostic | None:
    """What is left out, where the file asks for completeness."""
    if not file.must_be_complete or coverage.complete:
        return None
    left_out = [*(f"the state {path}" for path in coverage.missing_states), *coverage.missing_transitions]
    return Diagnostic(file.location, "M503", f"left out: {'; '.join(left_out)}")
