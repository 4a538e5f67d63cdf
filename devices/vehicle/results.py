"""The numbers with which the autopilot answers and speaks."""

from __future__ import annotations

from enum import IntEnum


class Result(IntEnum):
    """MAV_RESULT."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4


class Severity(IntEnum):
    """MAV_SEVERITY, those that are used."""

    CRITICAL = 2
    WARNING = 4
    INFO = 6
