"""The mission as a typed, frozen document: what the executive flies and what every check, proof and test looks at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from mission.language.diagnostics import MissionFileError as MissionFileError
from mission.language.location import NOWHERE, Location

if TYPE_CHECKING:
    from devices.world.settings import WorldSettings
    from mission.behaviours.behaviour import Parameters
    from mission.language.conditions import Condition
    from mission.language.invariants import Invariant
    from mission.language.limits import Limits
    from mission.language.rig_file import RigFile
    from mission.language.site_file import SiteFile
    from mission.language.turbine_file import TurbineFile

OUTCOMES = ("completed", "aborted", "refused", "released")
History = Literal["shallow", "deep"]


@dataclass(frozen=True)
class Transition:
    """What an event leads to. `source` is the state that declares it ("" for the mission's own `on`).

    target: absolute dotted path. when, unless: guards. after_s: it is taken so many seconds after its event, if the
    state is still active and the guards still hold then. retries: how often it may be taken in a run; used up, it
    passes the event on. backoff_s: wait before the second, third, … time: once, twice, four times as long. history:
    enter the target where it was left. confirm: with autonomy `confirm` the operator is asked. index: place among the
    entries of its event.
    """

    event: str
    target: str
    source: str = ""
    when: Condition | None = None
    unless: Condition | None = None
    after_s: float | None = None
    retries: int | None = None
    backoff_s: float = 0.0
    history: History | None = None
    confirm: bool = False
    index: int = 0
    location: Location = NOWHERE

    @property
    def key(self) -> str:
        """Names this transition within its mission, for counting how often it was taken."""
        return f"{self.source}:{self.event}#{self.index}"

    @property
    def guarded(self) -> bool:
        """Whether a condition can hold it back."""
        return self.when is not None or self.unless is not None


@dataclass(frozen=True)
class State:
    """One state. A leaf runs at most one behaviour (`do`); a composite has children, and `initial` among them."""

    path: str
    parent: str | None
    do: str | None = None
    parameters: Parameters | None = None
    timeout_s: float | None = None
    on: tuple[Transition, ...] = ()
    initial: str | None = None
    children: tuple[str, ...] = ()
    final: str | None = None
    limits: Limits | None = None
    entry: bool = False
    text: str = ""
    location: Location = NOWHERE

    @property
    def name(self) -> str:
        """The last part of the path."""
        return self.path.rpartition(".")[2]


@dataclass(frozen=True)
class Mission:
    """A whole mission, resolved: includes, references and overrides are done, every name means something.

    location: of the mission's own `on`, or of `states` without it: what holds for all states is said there.
    """

    name: str
    version: int
    states: Mapping[str, State]
    initial: str
    turbine: TurbineFile
    rig: RigFile
    site: SiteFile
    world: WorldSettings | None
    limits: Limits
    parameters: Mapping[str, Any]
    resolved_yaml: str
    path: Path
    on: tuple[Transition, ...] = ()
    invariants: tuple[Invariant, ...] = ()
    text: str = ""
    location: Location = NOWHERE

    def ancestors(self, path: str) -> tuple[str, ...]:
        """The state and all around it, innermost first."""
        return tuple(enclosing(path))

    def leaf(self, path: str) -> str:
        """Where one ends up on entering a state: `initial` followed down."""
        while (inner := self.states[path].initial) is not None:
            path = inner
        return path

    def leaves(self) -> tuple[str, ...]:
        """Every state that has no state inside, in file order."""
        return tuple(path for path, state in self.states.items() if not state.children)

    def handlers(self, path: str, event: str) -> tuple[Transition, ...]:
        """Transitions that may answer an event in a state, in the order in which they are tried.

        All entries for the event itself come first, inner states before outer ones; then those for the event it falls
        back to, and so on.
        """
        known = self._handlers.get((path, event))
        if known is None:
            from mission.executive.events import fallbacks

            owners = [self.states[owner].on for owner in self.ancestors(path)] + [self.on]
            known = self._handlers[path, event] = tuple(
                transition
                for name in fallbacks(event)
                for owner in owners
                for transition in owner
                if transition.event == name
            )
        return known

    @cached_property
    def _handlers(self) -> dict[tuple[str, str], tuple[Transition, ...]]:
        """What `handlers` has found so far: the proof and the executive ask again and again."""
        return {}

    def transitions(self) -> tuple[Transition, ...]:
        """Every declared transition."""
        return self.on + tuple(transition for state in self.states.values() for transition in state.on)


def enclosing(path: str) -> Iterator[str]:
    """`a.b.c`, `a.b`, `a`."""
    while path:
        yield path
        path = path.rpartition(".")[0]


def load(path: Path | str, overrides: Sequence[str] = (), rig: str | None = None) -> Mission:
    """Read, resolve and check a mission file.

    overrides: `a.b=value`, addressed to the resolved document. rig: a rig file instead of the mission's own, relative
    to the working folder.

    Raises:
        MissionFileError: with every diagnostic found; each prints as `file:line:column: CODE message`.
    """
    from mission.language.loading import load_mission

    return load_mission(Path(path), overrides, rig)
