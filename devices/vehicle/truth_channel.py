"""A loopback question and answer beside MAVLink: where the vehicle truly is now (for the simulated cameras, and for
nothing that flies), and the switches for faults."""

from __future__ import annotations

import json
import socket
import struct
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from devices.vehicle.vehicle import TruePose

_ASK = struct.Struct("<4sI")
_ANSWER = struct.Struct("<4sI12d")
_POSE = b"POSE"
_TRIES = 10
_TRY_S = 0.2


class TruthError(RuntimeError):
    """The simulated vehicle does not answer, or does not know the command; one line for a person."""


class TruthClient:
    """`TruthClient(port).pose()`. Safe from any thread.

    Raises:
        TruthError: no answer within two seconds.
    """

    def __init__(self, port: int, host: str = "127.0.0.1") -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((host, port))
        self._socket.settimeout(_TRY_S)
        self._lock = threading.Lock()
        self._asked = 0

    def pose(self) -> TruePose:
        """The true pose at the moment of asking."""
        with self._lock:
            self._asked = (self._asked + 1) % 2**32
            question = _ASK.pack(_POSE, self._asked)

            def fits(data: bytes) -> bool:
                return len(data) == _ANSWER.size and data[:8] == question

            n = _ANSWER.unpack(self._ask(question, fits))[2:]
        return TruePose(n[0], np.array(n[1:4]), np.array(n[4:7]), np.array(n[7:10]), np.array(n[10:12]))

    def command(self, name: str, **arguments: Any) -> dict[str, Any]:
        """Throw a switch; see `FaultSwitches` for the names and their arguments.

        Raises:
            TruthError: it is not known, or an argument is wrong.
        """
        with self._lock:
            self._asked = (self._asked + 1) % 2**32
            ticket = self._asked
            question = json.dumps({"command": name, "ticket": ticket, **arguments}).encode()

            def fits(data: bytes) -> bool:
                return data.startswith(b"{") and json.loads(data).get("ticket") == ticket

            answer: dict[str, Any] = json.loads(self._ask(question, fits))
        if "error" in answer:
            raise TruthError(f"the simulated vehicle refuses {name!r}: {answer['error']}")
        return answer

    def tell(self, name: str, **arguments: Any) -> None:
        """Throw a switch without waiting for an answer: never blocks and never raises. Said twice under one ticket,
        lest a datagram is lost. For a client that asks nothing else."""
        self._asked = (self._asked + 1) % 2**32
        told = json.dumps({"command": name, "ticket": self._asked, **arguments}).encode()
        for _ in range(2):
            with suppress(OSError):  # the process is gone: whoever waits for its answers says so
                self._socket.send(told)

    def close(self) -> None:
        """Close the socket; idempotent."""
        self._socket.close()

    def _ask(self, question: bytes, fits: Callable[[bytes], bool]) -> bytes:
        for _ in range(_TRIES):
            try:
                self._socket.send(question)
                deadline = time.monotonic() + _TRY_S
                while time.monotonic() < deadline:
                    data = self._socket.recv(4096)
                    if fits(data):
                        return data
            except TimeoutError:
                continue
            except OSError:
                time.sleep(_TRY_S)
        raise TruthError("the simulated vehicle does not answer; its process is gone")


def answer(data: bytes, pose: Callable[[], TruePose], command: Callable[[dict[str, Any]], dict[str, Any]]) -> bytes:
    """The answer to one datagram of a TruthClient; empty for anything else. A repeated question may run twice: the
    switches are such that this does no harm except for jumps, so `command` must remember tickets."""
    if len(data) == _ASK.size and data[:4] == _POSE:
        p = pose()
        return _ANSWER.pack(*_ASK.unpack(data), p.time_s, *p.position, *p.velocity, *p.attitude, *p.gimbal)
    try:
        request = json.loads(data)
    except ValueError:
        return b""
    return json.dumps(command(request)).encode() if isinstance(request, dict) else b""
