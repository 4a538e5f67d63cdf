"""Whoever else commands the vehicle keeps it: what this program did not arm, or what was taken, it leaves alone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flight.autopilot import AutopilotError, Setpoint
from mission.behaviours.behaviour import behaviours
from tests.mission.executive.conftest import OUTCOMES, MemoryAutopilot

BEHAVIOURS = behaviours()
END = {
    "completed": {"final": "completed"},
    "aborted": {"final": "aborted"},
    "refused": {"final": "refused"},
    "released": {"final": "released"},
}
PILOT = {"pilot_took_over": "released"}
HERE = np.array([1.0, 2.0, -30.0])


class Obedient(MemoryAutopilot):
    """Reports the mode that it is told; refuses the commands named, once each."""

    def __init__(self, *refusals: str) -> None:
        super().__init__()
        self.refusals = list(refusals)

    def _told(self, command: str, mode: str) -> None:
        self.commands.append(command)
        if command in self.refusals:
            self.refusals.remove(command)
            raise AutopilotError("refused")
        self.says(flight_mode=mode)

    async def land(self) -> None:
        self._told("land", "LAND")

    async def arm(self) -> None:
        self.commands.append("arm")
        self.says(armed=True)

    async def take_off(self, height_m: float) -> None:
        self._told("take_off", "TAKEOFF")
        self.says(in_air=True)

    async def parameters(self, names: Any) -> dict[str, float]:
        return {"COM_OBL_RC_ACT": 5, "COM_OF_LOSS_T": 1.0, "COM_LOW_BAT_ACT": 2, "NAV_DLL_ACT": 0, "MNT_MODE_IN": 4}

    def point_gimbal(self, yaw: float, pitch: float) -> None: ...


def plainly(run: Any) -> Any:
    """The behaviour, its own words for success said as the `done` that these missions know."""

    async def ran(services: Any, parameters: Any) -> str:
        outcome = await run(services, parameters)
        return outcome if outcome in OUTCOMES else "done"

    return ran


def prepared(fly: Any, states: Any, autopilot: Obedient, runs: Any = None, **about: Any) -> Any:
    """A flight with the product's own behaviours over `autopilot`."""
    names = {state["do"] for state in states.values() if "do" in state} - set(runs or {})
    used = {name: plainly(BEHAVIOURS[name].run) for name in names}
    for state in states.values():
        if state.get("do") in names:
            state.setdefault("parameters", BEHAVIOURS[state["do"]].parameters())
    flight = fly({**states, **END}, {**used, **(runs or {})}, on=PILOT, **about)
    flight.services.autopilot = autopilot
    return flight


async def take(services: Any, parameters: Any) -> str:
    """Fly under setpoints, as after a take-off."""
    await services.setpoints.start(Setpoint(HERE.copy(), 0.5))
    services.autopilot._guarded.says(flight_mode="OFFBOARD")
    await services.clock.sleep(1.0)
    return "done"


LANDING = {"fly": {"do": "take", "on": {"done": "land"}}, "land": {"do": "land", "on": {"done": "completed"}}}


def landing(fly: Any, autopilot: Obedient, *at: Any) -> Any:
    return prepared(fly, {name: dict(state) for name, state in LANDING.items()}, autopilot, {"take": take}, at=at)


@pytest.mark.parametrize("mode", ["HOLD", "RTL", "MISSION", "POSCTL"])
def test_a_landing_that_somebody_ends_is_not_begun_again(fly: Any, mode: str) -> None:
    autopilot = Obedient()
    flight = landing(fly, autopilot, (3.0, lambda executive: autopilot.says(flight_mode=mode)))
    assert flight.run().outcome == "released"
    assert autopilot.commands == ["land"]


def test_a_refused_landing_is_asked_for_again(fly: Any) -> None:
    autopilot = Obedient("land", "land")
    flight = landing(fly, autopilot, (15.0, lambda executive: autopilot.says(armed=False, in_air=False)))
    assert flight.run().outcome == "completed"
    assert autopilot.commands == ["land"] * 3 + ["hold"], "on the ground it is left in a mode that can be armed"


def test_a_mode_that_is_not_ours_is_not_landed_over(fly: Any) -> None:
    autopilot = Obedient()
    flight = landing(fly, autopilot, (0.95, lambda executive: autopilot.says(flight_mode="RTL")))
    assert flight.run().outcome == "released"
    assert autopilot.commands == []


@pytest.mark.parametrize("mode", ["HOLD", "RTL", "LAND", "POSCTL"])
def test_a_take_off_that_somebody_ends_is_not_taken_over(fly: Any, mode: str) -> None:
    autopilot = Obedient()
    autopilot.says(armed=False, in_air=False, flight_mode="HOLD")
    states = {
        "launch": {"do": "take_off", "on": {"done": "completed", "failed": "land"}},
        "land": {"do": "land", "on": {"done": "aborted"}},
    }
    flight = prepared(fly, states, autopilot, at=[(2.0, lambda executive: autopilot.says(flight_mode=mode))])
    flight.services.setpoints.stop()
    assert flight.run().outcome == "released"
    assert autopilot.commands == ["arm", "take_off"]
    assert flight.services.setpoints.target is None


@pytest.mark.parametrize("in_air", [True, False])
def test_a_vehicle_that_somebody_else_has_armed_is_refused_and_left_alone(fly: Any, in_air: bool) -> None:
    autopilot = Obedient()
    autopilot.says(in_air=in_air, armable=False, flight_mode="MISSION")
    states = {"preflight": {"do": "check_vehicle", "on": {"done": "completed", "failed": "refused"}}}
    flight = prepared(fly, states, autopilot)
    flight.services.setpoints.stop()
    assert flight.run().outcome == "refused"
    assert autopilot.commands == []


def test_a_failed_launch_lands_nothing_that_this_mission_never_armed(fly: Any) -> None:
    autopilot = Obedient()
    autopilot.says(flight_mode="MISSION")
    states = {
        "launch": {"do": "take_off", "on": {"failed": "land"}},
        "land": {"do": "land", "on": {"done": "aborted"}},
    }
    flight = prepared(fly, states, autopilot)
    flight.services.setpoints.stop()
    flight.services.memory.home = None
    assert flight.run().outcome == "aborted"
    assert autopilot.commands == []


@pytest.mark.parametrize("name", ["back_off", "go_home", "climb_clear", "go_to", "hold"])
def test_an_abort_from_a_landing_flies_under_setpoints_again(fly: Any, name: str) -> None:
    autopilot = Obedient()
    states = {
        "fly": {"do": "take", "on": {"done": "land"}},
        "land": {"do": "land", "on": {"done": "completed", "abort": "away"}},
        "away": {"do": name, "timeout_s": 2, "on": {"failed": "aborted", "done": "aborted"}},
    }
    started: list[Any] = []
    interrupt = (3.0, lambda executive: executive.interrupt("SIGINT"))
    flight = prepared(fly, states, autopilot, {"take": take}, at=[interrupt])
    flight.services.turbine = SimpleNamespace(heading=0.0)
    flight.services.setpoints.keep_out = None

    stream = flight.services.setpoints
    stream.start = lambda first: begin(stream, autopilot, started, first)
    assert flight.run().outcome == "aborted"
    assert len(started) == 2
    np.testing.assert_allclose(started[1].position, HERE)


async def begin(stream: Any, autopilot: Obedient, started: list[Any], first: Setpoint) -> None:
    started.append(first)
    stream.target = first
    autopilot.says(flight_mode="OFFBOARD")


@pytest.mark.parametrize("name", ["back_off", "go_home", "climb_clear", "go_to", "hold"])
def test_on_the_ground_there_is_nothing_to_fly(fly: Any, name: str) -> None:
    autopilot = Obedient()
    autopilot.says(armed=False, in_air=False, flight_mode="HOLD")
    states = {"away": {"do": name, "timeout_s": 5, "on": {"done": "completed"}}}
    flight = prepared(fly, states, autopilot)
    flight.services.setpoints.stop()
    assert flight.run().outcome == "completed"
    assert autopilot.commands == []
