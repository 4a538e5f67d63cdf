"""The vehicle as a process of its own: paces simulated time by the wall clock, and serves its sockets."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

from devices.vehicle.fault_switches import FaultSwitches
from devices.vehicle.keeper import Keeper
from devices.vehicle.mavlink_face import MavlinkFace
from devices.vehicle.settings import ProcessSettings, Surroundings
from devices.vehicle.truth_channel import answer
from devices.vehicle.truth_log import TruthLog
from devices.vehicle.udp_link import UdpLink, bind_udp
from devices.vehicle.vehicle import ForwardRange, SimulatedVehicle, TruePose, VehicleEvent

_WAKE_S = 0.005
_CHUNK_S = 0.004
_LAG_MAX_S = 0.4


class VehicleServer:
    """Runs a vehicle until stopped.

    Simulated time is wall time times the speed. When the machine takes the processor away, up to 0.4 s of wall time are
    caught up, in small chunks between which the sockets are read; what is beyond that is left out, so that setpoints
    which waited in a socket are not mistaken for a stream that stopped.

    Raises:
        PortInUseError: a port cannot be had.
        OSError: the folder for the record cannot be written to.
    """

    def __init__(self, settings: ProcessSettings, forward_range: ForwardRange | None = None) -> None:
        self._settings = settings
        vehicle_settings = settings.vehicle.model_copy(update={"time_factor": settings.speed})
        self.vehicle = SimulatedVehicle(vehicle_settings, settings.seed, forward_range)
        self._last_setpoint_wall_s: float | None = None
        self.faces = [MavlinkFace(UdpLink(link), self.vehicle, self._on_setpoint) for link in settings.links]
        self._truth = bind_udp("127.0.0.1", settings.truth_port)
        self._switches = FaultSwitches(self.vehicle, [face.link for face in self.faces])
        self._answered: dict[tuple[str, int], dict[str, Any]] = {}
        self._asking: tuple[str, int] = ("", 0)
        self._log = TruthLog(settings.folder, self.vehicle, wall=True) if settings.folder is not None else None
        self._speed = settings.speed
        self._origin_s = time.monotonic()
        self._left_out_s = 0.0
        self._stopping: str | None = None
        parent = settings.parent_pid or os.getppid()
        self._keeper = Keeper(parent if settings.watch_parent else None, settings.orphan_s)

    @property
    def ports(self) -> dict[str, Any]:
        """What to tell whoever started it."""
        return {
            "pid": os.getpid(),
            "links": [{"role": face.link.role, "port": face.link.port} for face in self.faces],
            "truth_port": self._truth.getsockname()[1],
            "speed": self._settings.speed,
        }

    def change_speed(self, speed: float) -> None:
        """Go on from now at another speed; the autopilot's time-outs last as long on the wall's clock as before."""
        self.vehicle.firmware.parameters.stretch_times(speed / self._speed)
        self._speed = speed
        self._origin_s = time.monotonic() - self.vehicle.time_s / speed

    def stop(self, reason: str) -> None:
        """End `run` soon."""
        self._stopping = reason

    def run(self) -> None:
        """Fly until stopped, or until the parent is gone and the vehicle has landed."""
        sockets = [self._truth, *(face.link.socket for face in self.faces)]
        self._origin_s = time.monotonic() - self.vehicle.time_s / self._speed
        try:
            while self._stopping is None:
                select.select(sockets, [], [], _WAKE_S)
                self._serve()
                self._watch_parent()
        finally:
            self.close()

    def close(self) -> None:
        """Write the last event and close everything; idempotent."""
        if self._log is not None:
            with contextlib.suppress(ValueError):
                self._log.event(
                    VehicleEvent(
                        self.vehicle.time_s,
                        "stopped",
                        {"reason": self._stopping or "error", "left_out_s": round(self._left_out_s, 3)},
                    )
                )
            self._log.close()
            self._log = None
        self._truth.close()
        for face in self.faces:
            face.link.close()

    def _serve(self) -> None:
        for face in self.faces:
            face.receive()
        self._advance()
        self._answer_truth()

    def _advance(self) -> None:
        """Bring simulated time up to the wall clock."""
        speed = self._speed
        behind_s = time.monotonic() - self._origin_s - self.vehicle.time_s / speed
        if behind_s > _LAG_MAX_S:
            self._origin_s += behind_s - _LAG_MAX_S
            self._left_out_s += behind_s - _LAG_MAX_S
        chunks = 0
        while (time.monotonic() - self._origin_s) * speed - self.vehicle.time_s >= _CHUNK_S:
            self.vehicle.step(_CHUNK_S)
            for face in self.faces:
                face.send_due()
            self._write()
            chunks += 1
            if chunks % 5 == 0:
                for face in self.faces:
                    face.receive()
            if chunks >= 500:
                return

    def _write(self) -> None:
        if self._log is not None:
            self._log.update(last_setpoint_wall_s=self._last_setpoint_wall_s)

    def _on_setpoint(self) -> None:
        self._last_setpoint_wall_s = time.monotonic()

    def _answer_truth(self) -> None:
        while True:
            try:
                data, address = self._truth.recvfrom(4096)
            except BlockingIOError:
                return
            except OSError:
                continue
            self._asking = address
            reply = answer(data, self._pose_now, self._throw_switch)
            if reply:
                with contextlib.suppress(OSError):
                    self._truth.sendto(reply, address)

    def _pose_now(self) -> TruePose:
        return self.vehicle.pose()

    def _throw_switch(self, request: dict[str, Any]) -> dict[str, Any]:
        ticket, name = request.pop("ticket", 0), str(request.pop("command", ""))
        before = self._answered.get(self._asking)
        if before is not None and before["ticket"] == ticket:
            return before
        reply: dict[str, Any] = {"ticket": ticket, "time_s": self.vehicle.time_s}
        try:
            if name == "stop":
                self.stop("asked to")
            elif name == "speed":
                self.change_speed(float(request["speed"]))
            elif name == "adopt":
                reply |= self._adopted(**request)
            else:
                self._switches.run(name, request)
        except (ValueError, TypeError, OSError) as error:
            reply["error"] = str(error)
        self._answered[self._asking] = reply
        return reply

    def _adopted(self, token: str, pid: int, speed: float, folder: str) -> dict[str, Any]:
        """Another program takes the vehicle up, if the one before is gone."""
        if not token or token != self._settings.token:
            raise ValueError("it is another vehicle")
        if self._keeper.kept:
            return {"kept": True}
        log = TruthLog(Path(folder), self.vehicle, wall=True)
        self._keeper.hand_over(pid)
        self.change_speed(speed)
        self._note("adopted")
        if self._log is not None:
            self._log.close()
        self._log = log
        return {"kept": False, "pid": os.getpid()}

    def _watch_parent(self) -> None:
        died, enough = self._keeper.look(time.monotonic(), self.vehicle.firmware.armed)
        if died:
            self._note("parent_died")
        if enough is not None:
            self.stop(enough)

    def _note(self, kind: str) -> None:
        if self._log is not None:
            self._log.event(VehicleEvent(self.vehicle.time_s, kind, {}))


def range_finder(surroundings: Surroundings) -> ForwardRange:
    """What a range finder sees of a turbine. Asked once beforehand, so that nothing is compiled in flight."""
    from devices.world.turbine import TurbineShape
    from devices.world.world import World

    settings = surroundings.settings
    shape = TurbineShape.of(surroundings.turbine, surroundings.site, settings.survey_error)
    world = World(shape, settings)
    world.forward_range(np.zeros(3), np.zeros(3))
    return world.forward_range


def serve(settings: ProcessSettings) -> None:
    """Run a vehicle in this process until SIGTERM; print its ports as one JSON line first.

    Raises:
        PortInUseError, OSError: it could not start.
    """
    server = VehicleServer(settings, range_finder(settings.world) if settings.world is not None else None)
    signal.signal(signal.SIGTERM, lambda number, frame: server.stop("SIGTERM"))
    if settings.watch_parent:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    else:
        signal.signal(signal.SIGINT, lambda number, frame: server.stop("SIGINT"))
    print(json.dumps(server.ports), flush=True)
    server.run()
