"""Vehicles to test: in process in still air, and behind a MAVLink link whose other end is a plain pymavlink client."""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle.control import Target
from devices.vehicle.mavlink_face import MavlinkFace
from devices.vehicle.modes import Mode
from devices.vehicle.settings import LinkSettings, VehicleSettings
from devices.vehicle.udp_link import UdpLink
from devices.vehicle.vehicle import SimulatedVehicle
from devices.world.settings import Gps, Wind

STILL = {"wind": Wind(mean_m_s=0, gust_m_s=0), "gps": Gps(drift_m_min=0)}


class Pilot:
    """Flies a vehicle in process: what tests do again and again."""

    def __init__(self, **settings: Any) -> None:
        self.vehicle = SimulatedVehicle(VehicleSettings(**(STILL | settings)), seed=7)
        self.firmware = self.vehicle.firmware
        self.body = self.vehicle.body

    def until(self, condition: Callable[[], bool], within_s: float) -> float:
        """Seconds until the condition holds; the test fails when it does not in time."""
        start = self.vehicle.time_s
        while not condition():
            assert self.vehicle.time_s - start < within_s, f"not within {within_s} s: {self.firmware.describe()}"
            self.vehicle.step(0.02)
        return self.vehicle.time_s - start

    def airborne(self, height_m: float = 10.0) -> Pilot:
        """Take off and hold."""
        self.vehicle.step(4.5)
        assert self.firmware.arm() == 0
        assert self.firmware.take_off(-height_m) == 0
        self.until(lambda: self.firmware.mode is Mode.HOLD and not self.firmware.landed, 60)
        self.vehicle.step(3)
        return self

    def stream(self, target: Target, seconds: float, every_s: float = 0.05) -> None:
        """Send an offboard setpoint again and again, in OFFBOARD from the first on."""
        end = self.vehicle.time_s + seconds
        while self.vehicle.time_s < end - 1e-9:
            self.firmware.offboard_setpoint(target)
            if self.firmware.intended is not Mode.OFFBOARD:
                assert self.firmware.set_mode(Mode.OFFBOARD) == 0
            self.vehicle.step(every_s)

    def noted(self, kind: str) -> list[Any]:
        """Events of a kind so far."""
        return [event for event in self.vehicle.events if event.kind == kind]


class Client:
    """A MAVLink client at the other end of one link of a vehicle in process; nothing runs unless `run` is called."""

    def __init__(self, pilot: Pilot, role: str = "onboard", source: tuple[int, int] = (1, 195)) -> None:
        self.vehicle = pilot.vehicle
        self.link = UdpLink(LinkSettings(role=role))  # type: ignore[arg-type]
        self.setpoints = 0
        self.face = MavlinkFace(self.link, self.vehicle, self._count)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._mav = mavlink.MAVLink(None, *source)
        self.received: list[Any] = []

    def _count(self) -> None:
        self.setpoints += 1

    def send(self, message: Any) -> None:
        self._socket.sendto(message.pack(self._mav), ("127.0.0.1", self.link.port))
        self.face.receive()
        self._read()

    def send_raw(self, message_id: int, crc_extra: int, payload: bytes) -> None:
        """Send a payload under a valid MAVLink 2 header and checksum."""
        head = struct.pack("<BBBBBB", len(payload), 0, 0, 0, 1, 195) + message_id.to_bytes(3, "little")
        check = mavlink.x25crc(head + payload)
        check.accumulate(bytes([crc_extra]))
        self._socket.sendto(b"\xfd" + head + payload + struct.pack("<H", check.crc), ("127.0.0.1", self.link.port))
        self.face.receive()
        self._read()

    def heartbeat(self, kind: int) -> None:
        self.send(mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))

    def command(self, number: int, *numbers: float, component: int = 1) -> list[int]:
        """Send a COMMAND_LONG and return the results of its acknowledgements."""
        before = len(self.received)
        padded = (*numbers, *(0.0,) * (7 - len(numbers)))
        self.send(mavlink.MAVLink_command_long_message(1, component, number, 0, *padded))
        return [m.result for m in self.received[before:] if m.get_type() == "COMMAND_ACK" and m.command == number]

    def run(self, seconds: float) -> None:
        """Let the vehicle fly and stream for so long."""
        end = self.vehicle.time_s + seconds
        while self.vehicle.time_s < end - 1e-9:
            self.vehicle.step(0.004)
            self.face.send_due()
            self._read()

    def messages(self, kind: str) -> list[Any]:
        return [message for message in self.received if message.get_type() == kind]

    def close(self) -> None:
        self._socket.close()
        self.link.close()

    def _read(self) -> None:
        while True:
            try:
                data = self._socket.recv(4096)
            except BlockingIOError:
                return
            self.received += self._mav.parse_buffer(data) or []


@pytest.fixture
def pilot() -> Callable[..., Pilot]:
    return Pilot


@pytest.fixture
def client() -> Iterator[Callable[..., Client]]:
    clients: list[Client] = []

    def make(pilot: Pilot, **options: Any) -> Client:
        clients.append(Client(pilot, **options))
        return clients[-1]

    yield make
    for one in clients:
        one.close()
