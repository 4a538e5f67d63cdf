"""Start a simulated vehicle beside this process, and stop it again."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import secrets
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path

from devices.vehicle.handover import VehicleNote
from devices.vehicle.settings import ProcessSettings

START_S = 30.0
_STOP_S = 5.0


class SpawnError(RuntimeError):
    """The vehicle did not start; one line for a person."""


@dataclass(frozen=True)
class VehicleProcess:
    """A running vehicle. link_ports: where each of its links listens. `system_address` is what MAVSDK connects to.
    token: with which another program may take it up once this one is gone."""

    process: subprocess.Popen[str]
    link_ports: tuple[int, ...]
    truth_port: int
    system_address: str
    token: str = ""

    @property
    def note(self) -> VehicleNote:
        """What another program needs to take it up."""
        return VehicleNote(
            pid=self.process.pid, truth_port=self.truth_port, system_address=self.system_address, token=self.token
        )

    @property
    def alive(self) -> bool:
        """Whether it still runs."""
        return self.process.poll() is None

    def stop(self) -> None:
        """End it: SIGTERM, and SIGKILL should it not listen. Idempotent."""
        if self.process.poll() is None:
            self.process.terminate()
        try:
            self.process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                pipe.close()


def spawn(settings: ProcessSettings) -> VehicleProcess:
    """Start `python -m devices.vehicle` and wait until it has opened its ports.

    It runs in a session of its own, so that Ctrl-C in the terminal reaches only the caller. What it says on stderr is
    kept for the error message.

    Raises:
        SpawnError: it said why it cannot start, or said nothing for half a minute.
    """
    settings = settings.model_copy(update={"parent_pid": os.getpid(), "token": settings.token or secrets.token_hex(16)})
    with tempfile.TemporaryFile("w+") as complaints:
        process = subprocess.Popen(
            [sys.executable, "-m", "devices.vehicle", "--config", "-"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            text=True,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
            cwd=Path(__file__).resolve().parents[2],
        )
        line = _first_line(process, settings.model_dump_json())
        if not line:
            process.kill()
            process.wait()
            complaints.seek(0)
            said_last = (complaints.read().strip().splitlines() or ["it said nothing"])[-1]
            raise SpawnError(f"the simulated vehicle did not start: {said_last}")
    said = json.loads(line)
    ports = tuple(link["port"] for link in said["links"])
    first = settings.links[0]
    if first.remote_port is None:
        address = f"udpout://127.0.0.1:{ports[0]}"
    else:
        address = f"udpin://{first.remote_host}:{first.remote_port}"
    return VehicleProcess(process, ports, said["truth_port"], address, settings.token)


def _first_line(process: subprocess.Popen[str], configuration: str) -> str:
    """Hand over the configuration, and wait for the first line of stdout; empty when the process ends or stays
    silent."""
    stdin, stdout = process.stdin, process.stdout
    assert stdin is not None and stdout is not None
    with contextlib.suppress(BrokenPipeError):
        stdin.write(configuration)
        stdin.close()
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=lambda: lines.put(stdout.readline()), daemon=True).start()
    try:
        return lines.get(timeout=START_S)
    except queue.Empty:
        return ""
