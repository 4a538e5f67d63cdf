"""The autopilot's parameters: the part of PX4's table that this vehicle obeys or that clients ask for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

_SCALED_WITH_TIME = ("COM_OF_LOSS_T", "COM_DL_LOSS_T", "COM_RC_LOSS_T")

# Whole numbers are PX4's INT32, the others its FLOAT.
DEFAULTS: Mapping[str, int | float] = {
    "BAT1_CAPACITY": 5200.0,
    "BAT1_N_CELLS": 4,
    "BAT_CRIT_THR": 0.07,
    "BAT_EMERGEN_THR": 0.05,
    "BAT_LOW_THR": 0.15,
    "CAL_ACC0_ID": 1310988,
    "CAL_GYRO0_ID": 1310988,
    "CAL_MAG0_ID": 197388,
    "CBRK_SUPPLY_CHK": 0,
    "COM_ARM_WO_GPS": 0,
    "COM_DISARM_LAND": 2.0,
    "COM_DISARM_PRFLT": 10.0,
    "COM_DL_LOSS_T": 10,
    "COM_FAIL_ACT_T": 5.0,
    "COM_LOW_BAT_ACT": 3,
    "COM_OBL_RC_ACT": 5,
    "COM_OF_LOSS_T": 1.0,
    "COM_RCL_EXCEPT": 0,
    "COM_RC_IN_MODE": 1,
    "COM_RC_LOSS_T": 0.5,
    "COM_RC_OVERRIDE": 1,
    "COM_SPOOLUP_TIME": 1.0,
    "GF_ACTION": 2,
    "GF_MAX_HOR_DIST": 0.0,
    "GF_MAX_VER_DIST": 0.0,
    "MAV_COMP_ID": 1,
    "MAV_SYS_ID": 1,
    "MAV_TYPE": 2,
    "MIS_TAKEOFF_ALT": 2.5,
    "MNT_MODE_IN": 4,
    "MNT_MODE_OUT": 2,
    "MPC_LAND_ALT1": 10.0,
    "MPC_LAND_ALT2": 5.0,
    "MPC_LAND_ALT3": 1.0,
    "MPC_LAND_CRWL": 0.3,
    "MPC_LAND_SPEED": 0.7,
    "MPC_TKO_RAMP_T": 3.0,
    "MPC_TKO_SPEED": 1.5,
    "MPC_XY_CRUISE": 5.0,
    "MPC_XY_VEL_MAX": 12.0,
    "MPC_Z_VEL_MAX_DN": 1.5,
    "MPC_Z_VEL_MAX_UP": 3.0,
    "NAV_ACC_RAD": 2.0,
    "NAV_DLL_ACT": 0,
    "NAV_RCL_ACT": 2,
    "RTL_CONE_ANG": 45,
    "RTL_DESCEND_ALT": 30.0,
    "RTL_LAND_DELAY": 0.0,
    "RTL_RETURN_ALT": 60.0,
    "RTL_TYPE": 0,
    "SYS_AUTOCONFIG": 0,
    "SYS_AUTOSTART": 10040,
    "SYS_HITL": 0,
}


class ParameterTable:
    """Values by name, in alphabetical order as PX4 numbers them. Whole-number parameters stay whole."""

    def __init__(self, changes: Mapping[str, float], time_factor: float = 1.0) -> None:
        self._values: dict[str, int | float] = dict(sorted(DEFAULTS.items()))
        for name in _SCALED_WITH_TIME:
            value = self._values[name] * time_factor
            self._values[name] = round(value) if isinstance(self._values[name], int) else value
        for name, value in changes.items():
            if not self.set(name, value):
                raise ValueError(f"parameter {name!r} is not one of the simulated autopilot's")

    def __getitem__(self, name: str) -> int | float:
        return self._values[name]

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def set(self, name: str, value: float) -> bool:
        """Change a value; False where there is no such parameter, or the value is no number."""
        if name not in self._values or not math.isfinite(value):
            return False
        self._values[name] = round(value) if isinstance(self._values[name], int) else float(value)
        return True

    def stretch_times(self, factor: float) -> None:
        """Multiply the time-outs, as when simulated time changes speed: on the wall clock they stay."""
        for name in _SCALED_WITH_TIME:
            self.set(name, self._values[name] * factor)

    def is_whole(self, name: str) -> bool:
        """Whether it is an INT32."""
        return isinstance(self._values[name], int)

    def index(self, name: str) -> int:
        """Its number in the list."""
        return list(self._values).index(name)
