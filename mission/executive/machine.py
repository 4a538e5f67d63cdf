"""The mission compiled to the `transitions` library: it holds the active state and walks the hierarchy.

Names, targets and guards have been proven sound before; the library would not notice. History, retries and the chain
of events that one event falls back to are compiled into guarded transitions, so that the library answers exactly as
`mission.language.semantics` says. The two are held against each other at every step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from transitions.extensions.asyncio import (
    AsyncEventData,
    HierarchicalAsyncMachine,
    NestedAsyncState,
    NestedAsyncTransition,
)

from mission.executive.events import fallbacks
from mission.language import semantics
from mission.language.document import Mission, Transition, enclosing
from mission.language.semantics import Configuration, Quantities, Step

_ENTRY = 1000  # from this index on a transition is the operator's, and only taken when it is named


class MachineError(RuntimeError):
    """The library and the rules of the language disagree: an error of this program, never of a mission."""


class _State(NestedAsyncState):
    separator = "."


class _Transition(NestedAsyncTransition):
    """Carried out without what costs time and gives nothing here: tasks for guards, and callbacks, of which no state
    has any."""

    async def execute(self, event_data: Any) -> bool:  # type: ignore[override, unused-ignore]
        guards: list[Any] = self.conditions
        actions: list[Any] = self.before
        if not all(guard.func(event_data) for guard in guards):
            return False
        for action in actions:
            action(event_data)
        event_data.model.state = self.dest  # a leaf, as compiled: there is nothing to look up
        return True


class _Library(HierarchicalAsyncMachine):
    """One active leaf, one task that moves it, and every transition under its state's whole path: an event need not be
    sought scope by scope, nor as a task that others may cancel."""

    state_cls = _State
    transition_cls = _Transition

    async def trigger_event(  # type: ignore[override, unused-ignore]
        self, model: Any, trigger: str, *about: Any, **more: Any
    ) -> bool:
        """Try the transitions of the event, the innermost active state's first; whether one was carried out."""
        event: Any = self.events[trigger]
        about_it = AsyncEventData(None, event, self, model, about, more)
        for source in enclosing(model.state):
            for transition in event.transitions.get(source, ()):
                if await transition.execute(about_it):
                    return True
        return False


@dataclass
class _Attempt:
    """An event on its way through the library: what its guards look at, and which transition answered."""

    quantities: Quantities
    origin: str | None = None
    only: Transition | None = None
    taken: Transition | None = None


class _Position:
    """The library's model: it keeps `state`, the path of the active leaf."""

    state: str


def entries(mission: Mission) -> dict[str, Transition]:
    """The states that the mission marks as an entry, with the transition by which an operator may skip to them."""
    marked = [path for path, state in mission.states.items() if state.entry]
    return {path: Transition("skip", path, index=_ENTRY + number) for number, path in enumerate(marked)}


class Machine:
    """One run's machine. `configuration` is where it is; `take` is the only way to move it."""

    def __init__(self, mission: Mission, configuration: Configuration | None = None) -> None:
        """Compile a mission and stand in a configuration of it; without one, where the mission begins."""
        self.mission = mission
        self.configuration = configuration or semantics.start(mission)
        self._position = _Position()
        self._attempt = _Attempt({})
        self._library = _Library(
            model=self._position,
            states=[self._compiled(path) for path, state in mission.states.items() if state.parent is None],
            transitions=list(self._transitions()),
            initial=self.configuration.leaf,
            send_event=True,
            auto_transitions=False,
            ignore_invalid_triggers=True,
            queued=False,
        )

    @property
    def state(self) -> str:
        """Path of the active leaf."""
        return self._position.state

    def choose(self, event: str, quantities: Quantities, origin: str | None = None) -> Transition | None:
        """The transition that would answer an event now; None where nothing does."""
        return semantics.choose(self.mission, self.configuration, event, quantities, origin)

    async def take(
        self,
        event: str,
        quantities: Quantities,
        origin: str | None = None,
        only: Transition | None = None,
        says: Step | None = None,
    ) -> Step | None:
        """Let the event happen: the transition that answers it is carried out. None where nothing answers.

        only: the one transition that may be taken, where its delay has passed or the operator has agreed to it. says:
        what the rules say that this one does, where that is known already.

        Raises:
            MachineError: the library ended elsewhere than the rules say.
        """
        before = self.configuration
        attempt = self._attempt = _Attempt(quantities, origin, only)
        for name in fallbacks(event) if only is None else (only.event,):
            if name in self._library.events and await self._library.trigger_event(self._position, name):
                break
        if attempt.taken is None:
            if only is not None:
                raise MachineError(f"{event} in {before.leaf}: {only.key} was chosen, but the machine did not take it")
            return None
        step = says or semantics.take(self.mission, before, attempt.taken, event)
        if self.state != step.after.leaf:
            raise MachineError(
                f"{event} in {before.leaf}: the machine went to {self.state}, the rules say {step.after.leaf}"
            )
        self.configuration = step.after
        return step

    def _compiled(self, path: str) -> dict[str, Any]:
        state = self.mission.states[path]
        compiled: dict[str, Any] = {"name": state.name, "final": state.final is not None}
        if state.children:
            compiled["children"] = [self._compiled(child) for child in state.children]
            compiled["initial"] = (state.initial or state.children[0]).removeprefix(path + ".")
        return compiled

    def _transitions(self) -> Iterator[dict[str, Any]]:
        """Inner entries stand on their own states; the mission's own `on` on every outermost state, after its own."""
        outermost = [path for path, state in self.mission.states.items() if state.parent is None]
        for state in self.mission.states.values():
            for transition in state.on:
                yield from self._variants(state.path, transition)
        for path in outermost:
            for transition in (*self.mission.on, *entries(self.mission).values()):
                yield from self._variants(path, transition)

    def _variants(self, source: str, transition: Transition) -> Iterator[dict[str, Any]]:
        """A transition of the library for each leaf in which it may end: one, or with history each remembered one."""
        for leaf in self._ends(transition):
            yield {
                "trigger": transition.event,
                "source": source,
                "dest": leaf,
                "conditions": [partial(self._may, source, transition, leaf)],
                "before": partial(self._take, transition),
            }

    def _ends(self, transition: Transition) -> tuple[str, ...]:
        target, mission = transition.target, self.mission
        first = mission.leaf(target)
        if transition.history is None or not mission.states[target].children:
            return (first,)
        if transition.history == "shallow":
            others = {mission.leaf(child) for child in mission.states[target].children}
        else:
            others = {leaf for leaf in mission.leaves() if target in enclosing(leaf)}
        return (first, *sorted(others - {first}))

    def _may(self, source: str, transition: Transition, leaf: str, event_data: Any) -> bool:
        attempt = self._attempt
        if attempt.taken is not None or (attempt.only is not None and transition.key != attempt.only.key):
            return False
        if transition.event == "skip" and attempt.only is None and transition.index >= _ENTRY:
            return False
        if attempt.origin is not None and source not in enclosing(attempt.origin):
            return False
        if semantics.used_up(transition, self.configuration):
            return False
        if not semantics.guards_hold(transition, attempt.quantities):
            return False
        return semantics.entered_leaf(self.mission, self.configuration, transition) == leaf

    def _take(self, transition: Transition, event_data: Any) -> None:
        self._attempt.taken = transition
