"""A behaviour that is stopped is gone: nothing of it waits for the garbage collector, which would stop a transition."""

from __future__ import annotations

import asyncio
import gc
import weakref
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from mission.behaviours.behaviour import behaviours
from mission.executive.gate import Gate
from mission.executive.work import Work


class Held:
    """Something that a behaviour has in its hands."""


async def test_what_a_stopped_behaviour_held_is_freed_at_once() -> None:
    held: list[weakref.ref[Held]] = []

    async def run(services: Any, parameters: Any) -> str:
        mine = Held()
        held.append(weakref.ref(mine))
        await asyncio.sleep(1e6)
        return str(mine)

    services: Any = SimpleNamespace(log=None)
    work = Work(services, Gate(), lambda activation, event, data: None)
    gc.disable()
    try:
        work.start(replace(behaviours()["hold"], run=run), None)
        await asyncio.sleep(0)
        assert held[0]() is not None
        assert await work.stop(lambda: None)
        await asyncio.sleep(0)
        assert held[0]() is None
    finally:
        gc.enable()
