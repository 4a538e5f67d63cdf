"""Which vehicle a flight speaks to: whether it is a simulated one, whether a person is asked, and how fast its time
runs. Decided here alone, for the command line and the flight alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, Protocol
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from mission.language.rig_file import RigFile

EMBEDDED = "embedded"
SIMULATED_KINDS = ("simulated", "px4_sitl")
SPEED_TOLERANCE = 0.2
LOOKS = 3  # a busy machine may spoil one second of looking at the vehicle's clock
TIMED_PARAMETERS = ("COM_OF_LOSS_T",)  # PX4 counts them in simulated seconds; what they guard is wall time
_LISTENING = ("udpin", "tcpin")
_LOOPBACK = ("localhost", "::1")


class Timed(Protocol):
    """A link that can tell how fast the vehicle's time runs."""

    async def measured_speed(self, wall_s: float = 1.0) -> float | None: ...


def system_of(rig: RigFile, system: str | None) -> str:
    """Where the vehicle is: what was asked for, or what the rig file says."""
    return system or rig.system


def is_simulated(rig: RigFile, system: str | None = None) -> bool:
    """Whether no real vehicle moves.

    Serial lines and peers on other machines count as real, whatever the rig draws its images from. A port that is
    listened on counts as simulated for a simulated rig, since simulators send there by themselves.
    """
    if rig.kind == "hardware":
        return False
    address = system_of(rig, system)
    if address == EMBEDDED:
        return True
    if rig.kind not in SIMULATED_KINDS:
        return False
    parts = urlsplit(address)
    return parts.scheme in _LISTENING or _is_loopback(parts.hostname or "")


def must_confirm(rig: RigFile, system: str | None = None) -> bool:
    """Whether a person must say yes before the vehicle is armed: what the rig says, otherwise for every real one."""
    return not is_simulated(rig, system) if rig.confirm_arming is None else rig.confirm_arming


def speed_for(rig: RigFile, system: str | None, asked: float | None) -> float:
    """Mission seconds per wall second. The embedded simulator's speed says nothing about another vehicle's time."""
    if asked is not None:
        return asked
    elsewhere = system_of(rig, system) != EMBEDDED and rig.system == EMBEDDED
    return 1.0 if elsewhere or not is_simulated(rig, system) else rig.speed


def gimbal_for(rig: RigFile, system: str | None) -> Literal["auto", "mavlink", "process"]:
    """Who holds the gimbal. Another simulator than ours may have none; then one is simulated beside the cameras."""
    if rig.gimbal == "in_process":
        return "process"
    return "auto" if rig.kind == "simulated" and system_of(rig, system) != EMBEDDED else "mavlink"


async def speed_mismatch(link: Timed, speed: float, address: str) -> str | None:
    """One line where the vehicle's time does not run at `speed`; None where it does, or where it tells no time."""
    measured: float | None = None
    for _ in range(LOOKS):
        measured = await link.measured_speed()
        if measured is None or abs(measured - speed) <= SPEED_TOLERANCE * speed:
            return None
    assert measured is not None
    return (
        f"{address}: the vehicle's time runs {measured:.2g} times as fast as the wall clock, "
        f"the mission's {speed:g} times: give --speed {measured:.2g}, or slow down or speed up the simulator"
    )


def parameters_at(parameters: Mapping[str, float], speed: float) -> dict[str, float]:
    """The rig's parameters as the autopilot is to hold them at a simulation's speed."""
    return {name: value * speed if name in TIMED_PARAMETERS else value for name, value in parameters.items()}


def _is_loopback(host: str) -> bool:
    return host in _LOOPBACK or host.startswith("127.")
