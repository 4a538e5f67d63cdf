"""What truly happened, for the record of a simulated flight: truth.csv and vehicle_events.jsonl."""

from __future__ import annotations

import json
import time
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from devices.vehicle.vehicle import SimulatedVehicle, VehicleEvent

TRUTH_FILE = "truth.csv"
EVENTS_FILE = "vehicle_events.jsonl"
COLUMNS = (
    *("t", "n", "e", "d", "roll", "pitch", "yaw", "gimbal_yaw", "gimbal_pitch", "mode", "armed"),
    *("vn", "ve", "vd", "estimated_n", "estimated_e", "estimated_d", "wind_n", "wind_e", "battery", "wall_s"),
)
_PERIOD_S = 0.05


class TruthLog:
    """Appends to both files at 20 Hz of simulated time and flushes each row, so that a killed process leaves all it
    knew. A disk that is full later on loses rows, and never the vehicle.

    `wall`: write wall time too (`wall_s`, of time.monotonic, the same clock in every process of a machine); without it
    the column is empty and two runs alike give files alike. Call `update` after every step.

    Raises:
        OSError: the folder cannot be written to.
    """

    def __init__(self, folder: Path, vehicle: SimulatedVehicle, wall: bool) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._vehicle = vehicle
        self._wall = wall
        self._next_s = 0.0
        self._events_seen = len(vehicle.events)  # what was before is in the record of who had it then
        self._rows: IO[str] = (folder / TRUTH_FILE).open("w", encoding="utf-8")
        self._events: IO[str] = (folder / EVENTS_FILE).open("w", encoding="utf-8")
        self._rows.write(",".join(COLUMNS) + "\n")
        self._rows.flush()

    def update(self, **event_details: Any) -> None:
        """Write what is due; the details go into each event that is written now."""
        vehicle = self._vehicle
        while self._events_seen < len(vehicle.events):
            self.event(vehicle.events[self._events_seen], **event_details)
            self._events_seen += 1
        if vehicle.time_s >= self._next_s - 1e-9:
            self._next_s = max(self._next_s + _PERIOD_S, vehicle.time_s - _PERIOD_S)
            self._row()

    def event(self, event: VehicleEvent, **details: Any) -> None:
        """Write one event at once."""
        line: dict[str, Any] = {"t": round(event.time_s, 3), "kind": event.kind, **event.data, **details}
        if self._wall:
            line["wall_s"] = round(time.monotonic(), 4)
        with suppress(OSError):
            self._events.write(json.dumps(line) + "\n")
            self._events.flush()

    def close(self) -> None:
        """Close both files; idempotent."""
        for file in (self._rows, self._events):
            with suppress(OSError):
                file.close()

    def _row(self) -> None:
        vehicle, body, estimate = self._vehicle, self._vehicle.body, self._vehicle.estimate
        numbers = (body.n, body.e, body.d, body.roll, body.pitch, body.yaw, vehicle.gimbal.yaw, vehicle.gimbal.pitch)
        more = (body.vn, body.ve, body.vd, estimate.n, estimate.e, estimate.d, *vehicle.wind.velocity[:2])
        with suppress(OSError):
            self._rows.write(
                f"{vehicle.time_s:.3f},"
                + ",".join(f"{number:.4f}" for number in numbers)
                + f",{vehicle.firmware.mode.name},{int(vehicle.firmware.armed)},"
                + ",".join(f"{number:.3f}" for number in more)
                + f",{vehicle.battery.percent:.2f},{f'{time.monotonic():.4f}' if self._wall else ''}\n"
            )
            self._rows.flush()
