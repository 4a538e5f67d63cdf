"""What the vehicle reported and what it was told, as two CSV files."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from mission.record.row_file import RowFile

if TYPE_CHECKING:
    from flight.autopilot import Setpoint, Telemetry

COLUMNS = (
    "t,north,east,down,vn,ve,vd,roll_deg,pitch_deg,yaw_deg,gimbal_yaw_deg,gimbal_pitch_deg,"
    "set_north,set_east,set_down,set_yaw_deg,battery_percent,mode,armed,in_air,range_m,wind_n,wind_e,link_age_s"
)


class TelemetryRecorder:
    """telemetry.csv: metres in local NED, degrees, mission seconds. Call `record` ten times a mission second."""

    def __init__(self, path: Path, on_lost: Callable[[str], None] | None = None) -> None:
        self._file = RowFile(path, COLUMNS, on_lost)

    def record(self, stamp_s: float, telemetry: Telemetry, setpoint: Setpoint | None) -> None:
        """Append one row."""
        pose = telemetry.pose
        target = (*setpoint.position, math.degrees(setpoint.yaw)) if setpoint is not None else (None,) * 4
        wind = telemetry.wind if telemetry.wind is not None else (None, None)
        self._file.row(
            (
                stamp_s,
                *pose.position,
                *pose.velocity,
                *(math.degrees(angle) for angle in (*pose.attitude, *pose.gimbal)),
                *target,
                telemetry.battery_percent,
                telemetry.flight_mode,
                telemetry.armed,
                telemetry.in_air,
                telemetry.range_m,
                *wind,
                telemetry.link_age_s,
            )
        )

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class SetpointRecorder:
    """setpoints.csv: when each setpoint was sent, on the wall's clock and the mission's.

    `bounded`: the keep-out volume had moved it. `first` marks the first of a stream: the time before it was no gap,
    nobody was asked to send.
    """

    def __init__(self, path: Path, on_lost: Callable[[str], None] | None = None) -> None:
        self._file = RowFile(path, "wall_s,t,bounded,first", on_lost)

    def record(self, wall_s: float, stamp_s: float, bounded: bool = False, first: bool = False) -> None:
        """Append one row."""
        self._file.row((wall_s, stamp_s, bounded, first))

    def close(self) -> None:
        """Close the file."""
        self._file.close()
