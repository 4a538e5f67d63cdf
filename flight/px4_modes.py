"""PX4's flight modes by name and number, and what its command results mean."""

from __future__ import annotations

from collections.abc import Mapping

_MODES: Mapping[str, tuple[int, int]] = {
    "MANUAL": (1, 0),
    "ALTCTL": (2, 0),
    "POSCTL": (3, 0),
    "READY": (4, 1),
    "TAKEOFF": (4, 2),
    "HOLD": (4, 3),
    "MISSION": (4, 4),
    "RTL": (4, 5),
    "LAND": (4, 6),
    "FOLLOW_ME": (4, 8),
    "PRECLAND": (4, 9),
    "ACRO": (5, 0),
    "OFFBOARD": (6, 0),
    "STABILIZED": (7, 0),
}
_NAMES = {numbers: name for name, numbers in _MODES.items()}
_SUB_MODES_OF_MAIN = {4}

RESULTS: Mapping[int, str] = {
    0: "accepted",
    1: "temporarily rejected",
    2: "denied",
    3: "unsupported",
    4: "failed",
    5: "in progress",
    6: "cancelled",
}


def numbers_of(mode: str) -> tuple[int, int]:
    """Main and sub mode for MAV_CMD_DO_SET_MODE. Raises KeyError for a name that PX4 does not have."""
    return _MODES[mode]


def name_of(custom_mode: int) -> str:
    """The name of HEARTBEAT's or CURRENT_MODE's custom_mode; a readable number for one that is not known."""
    main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
    if main not in _SUB_MODES_OF_MAIN and (main, 0) in _NAMES:
        return _NAMES[main, 0]
    return _NAMES.get((main, sub), f"MODE_{main}_{sub}")
