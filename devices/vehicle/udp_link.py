"""One UDP link of the vehicle: a socket, a peer, MAVLink out and in."""

from __future__ import annotations

import contextlib
import errno
import socket
from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle.settings import LinkSettings

AUTOPILOT = 1
GIMBAL = 154
_GCS_TYPE = mavlink.MAV_TYPE_GCS
_MOST_DATAGRAMS = 200


class PortInUseError(RuntimeError):
    """The port cannot be had; one line for a person."""


def bind_udp(host: str, port: int) -> socket.socket:
    """A non-blocking UDP socket on this port, 0 for any free one.

    Raises:
        PortInUseError: somebody else has it, or the host is not one of this machine's.
    """
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        udp.bind((host, port))
    except OSError as error:
        udp.close()
        if error.errno == errno.EADDRINUSE:
            raise PortInUseError(f"UDP port {port} on {host} is in use; stop its owner or take another") from None
        raise PortInUseError(f"cannot listen on UDP {host}:{port}: {error.strerror}") from None
    udp.setblocking(False)
    return udp


class UdpLink:
    """Speaks to `peer`: the configured remote at first, then whoever was heard last.

    `up` False loses every datagram in both directions, as a broken radio does.
    """

    def __init__(self, settings: LinkSettings) -> None:
        self.role = settings.role
        self.socket = bind_udp(settings.host, settings.local_port)
        self.port: int = self.socket.getsockname()[1]
        self.peer: tuple[str, int] | None = None
        if settings.remote_port is not None:
            self.peer = (settings.remote_host, settings.remote_port)
        self.up = True
        self.hears_gcs = False
        self._autopilot = mavlink.MAVLink(None, AUTOPILOT, AUTOPILOT)
        self._gimbal = mavlink.MAVLink(None, AUTOPILOT, GIMBAL)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True

    def send(self, message: Any, component: int = AUTOPILOT) -> None:
        """Send one message in the name of the autopilot or the gimbal; lost without a listener, as UDP does."""
        if self.peer is None or not self.up:
            return
        encoder = self._autopilot if component == AUTOPILOT else self._gimbal
        data = message.pack(encoder)
        encoder.seq = (encoder.seq + 1) % 256
        with contextlib.suppress(OSError):
            self.socket.sendto(data, self.peer)

    def receive(self) -> Iterator[Any]:
        """The messages that have arrived. Broken datagrams are passed over."""
        for _ in range(_MOST_DATAGRAMS):
            try:
                data, address = self.socket.recvfrom(4096)
            except BlockingIOError:
                return
            except OSError:
                continue
            if not self.up:
                continue
            for message in self._parse(data):
                self.peer = address
                if message.get_type() == "HEARTBEAT" and message.type == _GCS_TYPE:
                    self.hears_gcs = True
                yield message

    def close(self) -> None:
        """Close the socket; idempotent."""
        self.socket.close()

    def _parse(self, data: bytes) -> list[Any]:
        try:
            messages = self._parser.parse_buffer(data) or []
        except mavlink.MAVError:
            return []
        return [message for message in messages if message.get_type() != "BAD_DATA"]
