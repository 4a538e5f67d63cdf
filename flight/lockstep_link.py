"""The simulated vehicle in process, in lockstep time: no socket, no thread, and the same flight every time.

It stands behind the same Protocol as PX4 over MAVSDK; commands go through the same firmware, and telemetry is sampled
as often as the MAVLink streams would bring it. The vehicle is handed in, so that nothing here depends on the simulator.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flight.autopilot import AutopilotError, Setpoint, Telemetry, VehiclePose
from flight.pose_history import PoseHistory

if TYPE_CHECKING:
    from devices.vehicle.truth_log import TruthLog
    from devices.vehicle.vehicle import SimulatedVehicle

POSE_PERIOD_S = 0.02  # GLOBAL_POSITION_INT and ATTITUDE_QUATERNION, 50 Hz
_SLOW_PERIODS_S = {"state": 0.2, "range": 0.1, "battery": 0.5, "wind": 0.5}
_COMPONENT = (1, 195)


class LockstepAutopilot:
    """`LockstepAutopilot(vehicle)`; hand its `advance` to the LockstepLoop.

    `start_s` is the executive's clock at the vehicle's boot. `up` False cuts the link: nothing arrives on either
    side.
    """

    simulated = True

    def __init__(self, vehicle: SimulatedVehicle, truth_log: TruthLog | None = None, start_s: float = 0.0) -> None:
        self.vehicle = vehicle
        self.up = True
        self._log = truth_log
        self._start_s = start_s
        self._elapsed_s = 0.0
        self._poses = PoseHistory()
        self._pose: VehiclePose | None = None
        self._due = dict.fromkeys(("pose", *_SLOW_PERIODS_S), 0.0)
        self._state = (False, False, "HOLD", False)
        self._battery = self._range_s = math.nan
        self._range: float | None = None
        self._wind: np.ndarray | None = None
        self._heard_s = -math.inf
        self._connected = False

    def advance(self, seconds: float) -> None:
        """Move the vehicle on, sampling telemetry on the way."""
        self._elapsed_s += seconds
        while self.vehicle.time_s + POSE_PERIOD_S <= self._elapsed_s + 1e-9:
            self.vehicle.step(POSE_PERIOD_S)
            if self._log is not None:
                self._log.update()
            if self.up:
                self._listen()

    async def connect(self, timeout_s: float) -> None:
        """Listen from now on; the vehicle is found with its first heartbeat."""
        self._connected = True
        await self._until(lambda: self._pose is not None, timeout_s, "no vehicle was heard")

    async def close(self) -> None:
        """Stop listening."""
        self._connected = False
        if self._log is not None:
            self._log.close()

    @property
    def telemetry(self) -> Telemetry:
        """The latest telemetry."""
        now = self._start_s + self._elapsed_s
        armed, in_air, mode, armable = self._state
        estimate = self.vehicle.settings
        pose = self._pose or VehiclePose(now, *(np.full(n, np.nan) for n in (3, 3, 3, 2)))
        age = now - self._heard_s
        down = pose.position[2]
        place = _global_position(estimate.latitude_deg, estimate.longitude_deg, estimate.altitude_m, pose.position)
        return Telemetry(
            pose=pose,
            connected=self._connected and age < 2.5,
            link_age_s=age,
            armed=armed,
            in_air=in_air,
            flight_mode=mode,
            armable=armable,
            battery_percent=self._battery,
            wind=self._wind,
            range_m=self._range,
            range_age_s=now - self._range_s if self._range_s == self._range_s else math.inf,
            global_position=place if down == down else None,
            position_sigma_m=self.vehicle.estimate.sigma_m,
        )

    def pose_at(self, stamp_s: float) -> VehiclePose | None:
        """The pose interpolated at a time on the executive's clock."""
        return self._poses.at(stamp_s)

    async def parameters(self, names: Sequence[str]) -> Mapping[str, float]:
        """Values of those parameters that there are."""
        await self._answer()
        table = self.vehicle.firmware.parameters
        return {name: float(table[name]) for name in names if name in table}

    async def set_parameter(self, name: str, value: float) -> None:
        """Change a parameter."""
        await self._answer()
        if not self.vehicle.firmware.parameters.set(name, value):
            raise AutopilotError(f"parameter {name}: the autopilot does not take {value:g}")

    async def arm(self) -> None:
        await self._command("arm", self.vehicle.firmware.arm)

    async def disarm(self) -> None:
        await self._command("disarm", self.vehicle.firmware.disarm)

    async def take_off(self, height_m: float) -> None:
        """Start a take-off to a height above the ground."""
        await self._command(
            "take-off", lambda: self.vehicle.firmware.take_off(self.vehicle.firmware.flight.home[2] - height_m)
        )

    async def land(self) -> None:
        await self._set_mode("LAND")

    async def hold(self) -> None:
        await self._set_mode("HOLD")

    async def start_offboard(self, first: Setpoint) -> None:
        """Stream `first` at 20 Hz until OFFBOARD flies."""
        for _ in range(3):
            self.send(first)
            await asyncio.sleep(0.05)
        await self._set_mode("OFFBOARD")
        for _ in range(40):
            self.send(first)
            if self._state[2] == "OFFBOARD":
                return
            await asyncio.sleep(0.05)
        raise AutopilotError("the vehicle did not enter OFFBOARD within 2 s")

    def send(self, setpoint: Setpoint) -> None:
        """Send one setpoint once."""
        if self._reaches:
            n, e, d = (float(value) for value in setpoint.position)
            self.vehicle.goto(n, e, d, float(setpoint.yaw))

    async def take_gimbal(self) -> None:
        await self._answer()
        self.vehicle.gimbal.take(*_COMPONENT)

    def point_gimbal(self, yaw: float, pitch: float) -> None:
        """Send gimbal angles once; without control they have no effect."""
        if self._reaches and self.vehicle.gimbal.primary == _COMPONENT:
            self.vehicle.gimbal.point(pitch, yaw, yaw_lock=True)

    @property
    def _reaches(self) -> bool:
        return self._connected and self.up

    async def _until(self, condition: Callable[[], bool], timeout_s: float, complaint: str) -> None:
        waited = 0.0
        while not condition():
            if waited >= timeout_s:
                raise AutopilotError(f"{complaint} within {timeout_s:g} s")
            await asyncio.sleep(0.02)
            waited += 0.02

    async def _answer(self) -> None:
        """The time that a command and its acknowledgement take on the wire."""
        await self._until(lambda: self._reaches, 2.0, "no answer from the vehicle")
        await asyncio.sleep(0.01)

    async def _command(self, what: str, command: Callable[[], int]) -> None:
        await self._answer()
        result = command()
        if result != 0:
            reasons = [text for severity, text in self.vehicle.texts[-1:] if severity <= 4]
            raise AutopilotError(f"{what} was refused" + (f": {reasons[0]}" if reasons else ""))

    async def _set_mode(self, name: str) -> None:
        await self._command(f"mode {name}", lambda: self.vehicle.set_mode(name))

    def _listen(self) -> None:
        vehicle = self.vehicle
        now = vehicle.time_s
        stamp = self._start_s + now
        self._heard_s = stamp
        estimate = vehicle.estimate
        position, velocity = (estimate.n, estimate.e, estimate.d), (estimate.vn, estimate.ve, estimate.vd)
        attitude, gimbal = (estimate.roll, estimate.pitch, estimate.yaw), tuple(vehicle.gimbal.reading)
        self._poses.position.add(stamp, (*position, *velocity))
        self._poses.attitude.add(stamp, attitude)
        self._poses.gimbal.add(stamp, gimbal)
        self._pose = VehiclePose(stamp, *(np.array(values) for values in (position, velocity, attitude, gimbal)))
        for name, period in _SLOW_PERIODS_S.items():
            if now >= self._due[name] - 1e-9:
                self._due[name] = now + period
                self._sample(name, stamp)

    def _sample(self, name: str, stamp: float) -> None:
        vehicle = self.vehicle
        if name == "state":
            firmware = vehicle.firmware
            self._state = (
                firmware.armed,
                firmware.armed and not firmware.landed,
                firmware.mode.name,
                firmware.not_armable is None,
            )
        elif name == "range":
            if vehicle.range_working:
                self._range, self._range_s = vehicle.range_m, stamp
        elif name == "battery":
            self._battery = float(math.ceil(vehicle.battery.percent))
        else:
            self._wind = np.array(vehicle.wind_estimate)


def _global_position(latitude: float, longitude: float, altitude: float, position: np.ndarray) -> np.ndarray:
    metres_per_degree = math.radians(1.0) * 6_371_000.0
    return np.array(
        [
            latitude + position[0] / metres_per_degree,
            longitude + position[1] / (metres_per_degree * math.cos(math.radians(latitude))),
            altitude - position[2],
        ]
    )
