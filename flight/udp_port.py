"""Is a UDP port free? A second bind by MAVSDK succeeds silently and then shares the datagrams at random."""

from __future__ import annotations

import errno
import re
import socket
from pathlib import Path

from flight.autopilot import AutopilotError


def check_address(system_address: str) -> None:
    """Raise AutopilotError, in one line, where the address is malformed, its port taken or its serial line absent."""
    kind, host, port = check_form(system_address)
    if kind == "udpin":
        _check_free(host, port)
    elif kind.startswith("serial") and not Path(host).exists():
        raise AutopilotError(f"{system_address}: there is no {host}: is the autopilot plugged in? (ls /dev/tty* tells)")


def check_form(system_address: str) -> tuple[str, str, int]:
    """Kind, host and port of an address; device and baud rate (0: the usual one) of a serial one.

    Raises:
        AutopilotError: malformed; one line.
    """
    match = re.fullmatch(r"(udpin|udpout|tcpin|tcpout|serial|serial_flowcontrol)://(.+)", system_address)
    if match is None:
        raise AutopilotError(
            f"{system_address!r} is no address of a vehicle: write for example udpin://0.0.0.0:14540, "
            "udpout://192.168.1.2:14580, tcpout://10.0.0.5:5760 or serial:///dev/ttyUSB0:921600"
        )
    kind, rest = match.groups()
    if kind.startswith("serial"):
        device, _, baud = rest.partition(":")
        return kind, device, int(baud) if baud.isdecimal() else 0
    host, colon, port = rest.rpartition(":")
    if not colon or not port.isdecimal() or not 0 < int(port) < 65536:
        raise AutopilotError(f"{system_address!r} lacks a port: write {kind}://HOST:PORT with a port from 1 to 65535")
    return kind, host, int(port)


def _check_free(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host.strip("[]"), port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise AutopilotError(
                    f"UDP port {port} is already in use: stop the other program that listens there "
                    f"(ss -lunp 'sport = {port}' names it), or take another port"
                ) from None
            raise AutopilotError(f"cannot listen on udpin://{host}:{port}: {error.strerror}") from None
