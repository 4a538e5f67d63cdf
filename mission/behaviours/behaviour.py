"""What a behaviour is: a coroutine with typed parameters and declared outcomes, registered by name."""

from __future__ import annotations

import importlib
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import BaseModel, ConfigDict

if TYPE_CHECKING:
    from mission.executive.services import Services


class Parameters(BaseModel):
    """Base of every behaviour's parameters: frozen, nothing unknown; fields carry units, limits and text."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class NoParameters(Parameters):
    """For behaviours that need nothing said."""


P = TypeVar("P", bound=Parameters)
Run = Callable[["Services", Any], Awaitable[str]]


@dataclass(frozen=True)
class Behaviour:
    """One entry of the registry.

    outcomes: name → what it means, the only values `run` may return. airborne: it expects to be flying while it runs,
    or None where it does not care. needs_vision: it cannot work without images. keeps_standoff: it keeps its parameter
    `standoff_m` all the time, so that the monitor may hold it to that. laser: it lights the laser; those that need
    images do unless they say otherwise. only_with: outcome → the parameter without which it never comes.
    """

    name: str
    run: Run
    parameters: type[Parameters]
    outcomes: Mapping[str, str]
    airborne: bool | None
    needs_vision: bool
    text: str
    keeps_standoff: bool = False
    laser: bool = False
    only_with: Mapping[str, str] = field(default_factory=dict)

    def outcomes_with(self, parameters: Parameters | None) -> Mapping[str, str]:
        """The outcomes that may come when it runs with these parameters."""
        return {
            name: text
            for name, text in self.outcomes.items()
            if name not in self.only_with or getattr(parameters, self.only_with[name], None) is not None
        }


_REGISTRY: dict[str, Behaviour] = {}


def behaviour(
    *,
    outcomes: Mapping[str, str],
    parameters: type[Parameters] = NoParameters,
    airborne: bool | None = True,
    needs_vision: bool = False,
    keeps_standoff: bool = False,
    laser: bool | None = None,
    only_with: Mapping[str, str] | None = None,
) -> Callable[[Callable[[Services, P], Awaitable[str]]], Callable[[Services, P], Awaitable[str]]]:
    """Register a coroutine as the behaviour of its own name; users read its docstring in `mission list behaviours`."""

    def register(run: Callable[[Services, P], Awaitable[str]]) -> Callable[[Services, P], Awaitable[str]]:
        name = run.__name__
        if name in _REGISTRY and _REGISTRY[name].run.__module__ != run.__module__:
            raise ValueError(f"behaviour {name!r} is declared in {_REGISTRY[name].run.__module__} and {run.__module__}")
        text = (run.__doc__ or "").strip()
        lit = needs_vision if laser is None else laser
        _REGISTRY[name] = Behaviour(
            name, run, parameters, dict(outcomes), airborne, needs_vision, text, keeps_standoff, lit, only_with or {}
        )
        return run

    return register


@cache
def behaviours() -> Mapping[str, Behaviour]:
    """Every behaviour of the package, by name. Each module beside this one that declares some is imported, so adding a
    file is enough; what only flying needs (numpy, guidance, vision) such a module imports in its functions."""
    package = __name__.rpartition(".")[0]
    for path in sorted(Path(__file__).parent.glob("*.py")):
        if "\n@behaviour(" in path.read_text("utf-8"):
            importlib.import_module(f"{package}.{path.stem}")
    return dict(sorted(_REGISTRY.items()))
