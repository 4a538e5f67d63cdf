"""What an event does to a configuration: the rules of the hierarchical machine, pure and synchronous.

The executive, the proof, the scenario tests and the replay all rest on these functions, so that what was proven and
tested is what flies.

- The innermost active state with an entry for the event answers first, then those around it, then the mission's own
  `on`; where none answers, the event that it falls back to is tried in the same way.
- Of several entries for one event the first whose guards hold and whose retries are not used up is taken.
- A transition leaves every state up to the one that holds both the active leaf and the target, and enters the target
  anew; a target that is active, or around the active leaf, is left and entered again.
- On being left, each composite remembers the leaf that was active in it. A transition with `history: deep` enters its
  target there; with `shallow`, in the same child of the target, entered afresh.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from mission.language.document import Mission, Transition, enclosing

Quantities = Mapping[str, float | bool | None]


@dataclass(frozen=True)
class Configuration:
    """Where the machine is. leaf: the active leaf. history: composite → leaf that was active when it was last left.
    taken: transition key → how often it was taken, for transitions with retries."""

    leaf: str
    history: Mapping[str, str] = field(default_factory=dict)
    taken: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def active(self) -> tuple[str, ...]:
        """The leaf and all states around it, innermost first."""
        return tuple(enclosing(self.leaf))


@dataclass(frozen=True)
class Step:
    """One transition carried out. exited: innermost first. entered: outermost first, the new leaf last."""

    event: str
    transition: Transition
    source: str
    exited: tuple[str, ...]
    entered: tuple[str, ...]
    after: Configuration


def start(mission: Mission) -> Configuration:
    """The configuration in which a mission begins."""
    return Configuration(mission.leaf(mission.initial))


def used_up(transition: Transition, configuration: Configuration) -> bool:
    """Whether the transition's retries are exhausted."""
    return transition.retries is not None and configuration.taken.get(transition.key, 0) >= transition.retries


def guards_hold(transition: Transition, quantities: Quantities) -> bool:
    """Whether `when` is known to be true and `unless` is not."""
    if transition.when is not None and not transition.when.evaluate(quantities):
        return False
    return transition.unless is None or not transition.unless.evaluate(quantities)


def answers(
    mission: Mission, configuration: Configuration, event: str, origin: str | None = None
) -> Iterator[Transition]:
    """Transitions that could answer the event now, in the order in which they are tried, guards left open.

    origin: the state that the event is about, where it is not the leaf: the deadline of a composite, for instance. It
    ends after the first unguarded one, which always answers.
    """
    for transition in mission.handlers(origin or configuration.leaf, event):
        if used_up(transition, configuration):
            continue
        yield transition
        if not transition.guarded:
            return


def choose(
    mission: Mission, configuration: Configuration, event: str, quantities: Quantities, origin: str | None = None
) -> Transition | None:
    """The transition that answers the event, None where nothing does."""
    for transition in answers(mission, configuration, event, origin):
        if guards_hold(transition, quantities):
            return transition
    return None


def delay_s(transition: Transition, configuration: Configuration) -> float:
    """Seconds from the event to the transition: `after_s`, and the back-off that doubles with every retry."""
    taken = configuration.taken.get(transition.key, 0)
    backoff = transition.backoff_s * 2 ** (taken - 1) if taken and transition.backoff_s else 0.0
    return (transition.after_s or 0.0) + backoff


def entered_leaf(mission: Mission, configuration: Configuration, transition: Transition) -> str:
    """The leaf in which a transition ends, history considered."""
    target = transition.target
    remembered = configuration.history.get(target)
    if target in configuration.active and mission.states[target].children:
        remembered = configuration.leaf
    if transition.history is None or remembered is None:
        return mission.leaf(target)
    if transition.history == "deep":
        return remembered
    child = remembered[len(target) + 1 :].split(".")[0]
    return mission.leaf(f"{target}.{child}")


def take(mission: Mission, configuration: Configuration, transition: Transition, event: str | None = None) -> Step:
    """Carry a transition out. `event` is the one that happened, where the transition answers one it falls back to."""
    target = transition.target
    leaf = entered_leaf(mission, configuration, transition)
    around_target = set(enclosing(target)) - {target}
    exited = tuple(path for path in configuration.active if path not in around_target)
    staying = set(configuration.active) - set(exited)
    entered = tuple(path for path in reversed(tuple(enclosing(leaf))) if path not in staying)
    history = dict(configuration.history)
    for path in exited:
        if mission.states[path].children:
            history[path] = configuration.leaf
    taken = dict(configuration.taken)
    if transition.retries is not None:
        taken[transition.key] = taken.get(transition.key, 0) + 1
    after = Configuration(leaf, history, taken)
    return Step(event or transition.event, transition, configuration.leaf, exited, entered, after)


def ended(mission: Mission, configuration: Configuration) -> str | None:
    """The outcome, once the machine is in a final state."""
    return mission.states[configuration.leaf].final
