"""The gate between behaviours and the vehicle: one that was abandoned, or flies against a pilot, gets no further."""

from __future__ import annotations

import asyncio
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TypeVar, cast

from mission.executive.commanded import MODE_OF, Commanded

if TYPE_CHECKING:
    from mission.executive.services import Services

T = TypeVar("T")

_COMMANDS = frozenset(
    ("arm", "disarm", "take_off", "land", "hold", "start_offboard", "send", "take_gimbal", "point_gimbal", "start")
)
_activation: ContextVar[int | None] = ContextVar("activation", default=None)


class Abandoned(asyncio.CancelledError):
    """Raised in a behaviour that has no say any more; it ends as if it were cancelled."""


class Gate:
    """Who may still command. Each run of a behaviour is an activation; the executive itself has none and always may."""

    def __init__(self) -> None:
        self.let_go = False
        self._revoked: set[int] = set()

    @staticmethod
    def enter(activation: int) -> None:
        """The present task, and every task that it starts, acts for this activation."""
        _activation.set(activation)

    def revoke(self, activation: int) -> None:
        """Nothing that this activation touches answers any more."""
        self._revoked.add(activation)

    def check(self, *, command: bool) -> None:
        """Whether the present task may go on.

        Raises:
            Abandoned: its activation was revoked, or it commands a vehicle that somebody else flies.
        """
        if command and self.let_go:
            raise Abandoned("somebody else flies")
        activation = _activation.get()
        if activation is not None and activation in self._revoked:
            raise Abandoned("the state was left")


class _Guarded:
    """Passes everything through to what it guards, while the gate lets it, and remembers what is commanded."""

    def __init__(self, guarded: Any, gate: Gate, commanded: Commanded) -> None:
        object.__setattr__(self, "_guarded", guarded)
        object.__setattr__(self, "_gate", gate)
        object.__setattr__(self, "_commanded", commanded)

    def __getattr__(self, name: str) -> Any:
        self._gate.check(command=name in _COMMANDS)
        found = getattr(self._guarded, name)
        if name != "arm" and name not in MODE_OF:
            return found

        def command(*values: Any, **named: Any) -> Any:
            self._commanded.asks(name)
            return found(*values, **named)

        return command

    def __setattr__(self, name: str, value: Any) -> None:
        self._gate.check(command=True)
        setattr(self._guarded, name, value)


def guard(value: T, gate: Gate, commanded: Commanded | None = None) -> T:
    """The same thing behind the gate."""
    return cast(T, _Guarded(value, gate, commanded or Commanded()))


def guard_services(services: Services, gate: Gate) -> None:
    """Put everything with which a behaviour acts behind the gate, in place."""
    services.autopilot = guard(services.autopilot, gate, services.commanded)
    services.setpoints = guard(services.setpoints, gate, services.commanded)
    services.perception = guard(services.perception, gate)
    services.clock = guard(services.clock, gate)
