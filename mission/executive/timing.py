"""What is due when: the deadlines of the active states and the transitions that wait for their time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from mission.language.document import Mission, Transition
from mission.language.semantics import Step


@dataclass(frozen=True)
class Waiting:
    """A transition that will be taken at `due_s`, answering an event that has already happened."""

    due_s: float
    event: str
    transition: Transition


@dataclass(frozen=True)
class Timing:
    """entered_s: active state → when it was entered. deadlines: active state → when its time is over."""

    entered_s: Mapping[str, float] = field(default_factory=dict)
    deadlines: Mapping[str, float] = field(default_factory=dict)
    waiting: tuple[Waiting, ...] = ()

    def entering(self, mission: Mission, paths: tuple[str, ...], now: float) -> Timing:
        """After these states were entered."""
        timed = {path: timeout for path in paths if (timeout := mission.states[path].timeout_s) is not None}
        return replace(
            self,
            entered_s={**self.entered_s, **dict.fromkeys(paths, now)},
            deadlines={**self.deadlines, **{path: now + timeout for path, timeout in timed.items()}},
        )

    def stepping(self, mission: Mission, step: Step, now: float) -> Timing:
        """After a transition: what was left is forgotten, what was entered begins."""
        left = set(step.exited)
        kept = Timing(
            {path: entered for path, entered in self.entered_s.items() if path not in left},
            {path: due for path, due in self.deadlines.items() if path not in left},
            tuple(entry for entry in self.waiting if entry.transition.source not in left),
        )
        return kept.entering(mission, step.entered, now)

    def delaying(self, entry: Waiting) -> Timing:
        """With another transition that waits; one that waits already keeps its time."""
        if any(other.transition.key == entry.transition.key for other in self.waiting):
            return self
        return replace(self, waiting=(*self.waiting, entry))

    def without(self, entry: Waiting) -> Timing:
        """After a waiting transition's time has come."""
        return replace(self, waiting=tuple(other for other in self.waiting if other is not entry))

    def expired(self, path: str) -> Timing:
        """After a deadline was acted upon; it does not come twice."""
        return replace(self, deadlines={other: due for other, due in self.deadlines.items() if other != path})

    def next_s(self) -> float | None:
        """When something is due next."""
        return min((*self.deadlines.values(), *(entry.due_s for entry in self.waiting)), default=None)

    def overdue(self, now: float) -> str | None:
        """The outermost active state whose time is over."""
        late = [path for path, due in self.deadlines.items() if due <= now + 1e-6]
        return min(late, key=len) if late else None

    def due(self, now: float) -> Waiting | None:
        """A waiting transition whose time has come, the earliest first."""
        ripe = [entry for entry in self.waiting if entry.due_s <= now + 1e-6]
        return min(ripe, key=lambda entry: entry.due_s) if ripe else None
