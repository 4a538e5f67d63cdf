"""A vehicle that outlived its program is taken up by the next: where to find it, and how to ask for it."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Protocol

from pydantic import BaseModel, ConfigDict, ValidationError

from devices.vehicle.keeper import Guardian
from devices.vehicle.truth_channel import TruthClient, TruthError

NOTE_FILE = "vehicle.json"
_STOP_S = 5.0


class RunningVehicle(Protocol):
    """A simulated vehicle in a process of its own, whoever started it."""

    @property
    def truth_port(self) -> int:
        """Where it answers a TruthClient."""
        ...

    @property
    def system_address(self) -> str:
        """What MAVSDK connects to."""
        ...

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        ...

    def stop(self) -> None:
        """End it; idempotent."""
        ...


class VehicleNote(BaseModel):
    """What a run leaves in its folder about its vehicle. pid: of its process. token: tells it from another one on the
    same port."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    pid: int
    truth_port: int
    system_address: str
    token: str

    def write(self, folder: Path) -> None:
        """Put it into a run's folder, whole.

        Raises:
            OSError: it cannot be written.
        """
        draft = folder / (NOTE_FILE + ".part")
        draft.write_text(self.model_dump_json() + "\n", "utf-8")
        draft.replace(folder / NOTE_FILE)


def note_in(folder: Path) -> VehicleNote | None:
    """The note in a run's folder; None where there is none, or none that can be read."""
    try:
        return VehicleNote.model_validate_json((folder / NOTE_FILE).read_text("utf-8"))
    except (OSError, ValidationError, UnicodeDecodeError):
        return None


class StillFlownError(RuntimeError):
    """The program that flies the vehicle is still there."""


class AdoptedVehicle:
    """A vehicle that this program did not start."""

    def __init__(self, pid: int, truth_port: int, system_address: str) -> None:
        self.truth_port, self.system_address = truth_port, system_address
        self._process = Guardian(pid)

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        return self._process.alive

    def stop(self) -> None:
        """End it: SIGTERM, and SIGKILL should it not listen. Idempotent."""
        until = time.monotonic() + _STOP_S
        number = signal.SIGTERM
        while self._process.alive:
            try:
                os.kill(self._process.pid, number)
            except ProcessLookupError:
                break
            while self._process.alive and time.monotonic() < until:
                time.sleep(0.02)
            number = signal.SIGKILL
            until = time.monotonic() + _STOP_S
        self._process.close()


def adopt(note: VehicleNote, *, speed: float, folder: Path) -> AdoptedVehicle | None:
    """Take up the vehicle of a note: from now on it lives as long as this process, at this speed, and writes its truth
    into `folder`. None where it is gone, or where another vehicle answers in its place.

    Raises:
        StillFlownError: the program that it belongs to is still running.
    """
    client = TruthClient(note.truth_port)
    try:
        told = client.command("adopt", token=note.token, pid=os.getpid(), speed=speed, folder=str(folder))
    except TruthError:
        return None
    finally:
        client.close()
    if told.get("kept"):
        raise StillFlownError("the run is still being flown: `mission status` shows it, `mission abort` ends it")
    return AdoptedVehicle(int(told["pid"]), note.truth_port, note.system_address)
