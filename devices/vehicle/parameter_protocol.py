"""MAVLink's parameter protocol as PX4 speaks it: whole numbers travel as the bytes of an INT32 in the float field."""

from __future__ import annotations

import struct
from typing import Any

from pymavlink.dialects.v20 import development as mavlink

from devices.vehicle.parameters import ParameterTable
from devices.vehicle.udp_link import AUTOPILOT, UdpLink

_WHOLE, _REAL = mavlink.MAV_PARAM_TYPE_INT32, mavlink.MAV_PARAM_TYPE_REAL32
_BURST = 10


class ParameterProtocol:
    """Answers PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET on one link."""

    def __init__(self, link: UdpLink, table: ParameterTable) -> None:
        self._link, self._table = link, table
        self._waiting: list[str] = []

    def handle(self, message: Any) -> None:
        """Answer one of the three messages if it is meant for the autopilot; unknown names stay unanswered, as with
        PX4."""
        if message.target_system not in (0, AUTOPILOT) or message.target_component not in (0, AUTOPILOT):
            return
        kind = message.get_type()
        if kind == "PARAM_REQUEST_LIST":
            self._waiting = list(self._table)
        elif kind == "PARAM_REQUEST_READ":
            names = list(self._table)
            index = message.param_index
            name = names[index] if 0 <= index < len(names) else message.param_id.rstrip("\0")
            if name in self._table:
                self._tell(name)
        elif kind == "PARAM_SET":
            name = message.param_id.rstrip("\0")
            if name in self._table:
                self._table.set(name, _decoded(message.param_value, message.param_type))
                self._tell(name)

    def send_waiting(self) -> None:
        """Send the next few of a requested list: a burst of all of them overflows small receive buffers."""
        for name in self._waiting[:_BURST]:
            self._tell(name)
        del self._waiting[:_BURST]

    def _tell(self, name: str) -> None:
        value = self._table[name]
        kind = _WHOLE if self._table.is_whole(name) else _REAL
        encoded = struct.unpack("<f", struct.pack("<i", int(value)))[0] if kind == _WHOLE else float(value)
        self._link.send(
            mavlink.MAVLink_param_value_message(name.encode(), encoded, kind, len(self._table), self._table.index(name))
        )


def _decoded(value: float, kind: int) -> float:
    if kind == _REAL:
        return value
    return float(struct.unpack("<i", struct.pack("<f", value))[0])
