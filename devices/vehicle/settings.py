"""What may be said of the simulated aircraft, its links and its process; from a JSON file or the assembly."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from devices.world.settings import Gps, Vehicle, Wind, WorldSettings


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Airframe(_Section):
    """Size of the quadrotor's answers; the defaults fly like PX4's SIH quadrotor with its stock tuning."""

    drag_1_s: float = Field(0.15, ge=0, description="Rotor drag: deceleration per metre a second of airspeed.")
    drag_1_m: float = Field(0.012, ge=0, description="Body drag: deceleration per squared airspeed.")
    tilt_max_deg: float = Field(40.0, gt=5, lt=70, description="Steepest tilt that the controller asks for.")
    rate_max_deg_s: float = Field(220.0, gt=10, description="Fastest roll and pitch.")
    yaw_rate_max_deg_s: float = Field(60.0, gt=5, description="Fastest turn.")
    yaw_bias_deg: float = Field(1.0, ge=-20, le=20, description="Constant error of the estimated heading.")


class VehicleSettings(_Section):
    """The aircraft and the air around it. The origin of local NED is the true place of take-off, on the ground."""

    wind: Wind = Field(default_factory=Wind)
    gps: Gps = Field(default_factory=Gps)
    aircraft: Vehicle = Field(default_factory=Vehicle)
    airframe: Airframe = Field(default_factory=Airframe)
    latitude_deg: float = Field(47.397742, ge=-90, le=90)
    longitude_deg: float = Field(8.545594, ge=-180, le=180)
    altitude_m: float = Field(488.0, description="Height of the take-off point above mean sea level.")
    heading_deg: float = Field(0.0, ge=-360, le=360, description="Heading on the ground, clockwise from north.")
    parameters: dict[str, float] = Field(default_factory=dict, description="Autopilot parameters that differ.")
    time_factor: float = Field(1.0, gt=0, le=100, description="Multiplies COM_OF_LOSS_T and the datalink times.")

    @classmethod
    def of_world(cls, world: WorldSettings, **changes: Any) -> VehicleSettings:
        """The vehicle in a world as users describe it: its wind, its GPS and its aircraft."""
        return cls(wind=world.wind, gps=world.gps, aircraft=world.vehicle, **changes)


class LinkSettings(_Section):
    """One UDP link. The vehicle listens on `local_port` and speaks to the remote, or to whoever spoke to it."""

    role: Literal["onboard", "gcs"] = "onboard"
    host: str = "127.0.0.1"
    local_port: int = Field(0, ge=0, le=65535, description="0: any free port; it is reported.")
    remote_host: str = "127.0.0.1"
    remote_port: int | None = Field(None, ge=1, le=65535, description="None: wait for the first datagram.")


class Surroundings(_Section):
    """What stands around the vehicle, for its range finder: the fields of a turbine and a site file, and the world."""

    turbine: dict[str, Any]
    site: dict[str, Any]
    settings: WorldSettings = Field(default_factory=WorldSettings)


class ProcessSettings(_Section):
    """A vehicle in its own process.

    folder: where truth.csv and vehicle_events.jsonl go, None for no record. watch_parent: when the process `parent_pid`
    (None: the one that started it) dies, fly on for `orphan_s` wall seconds, or until landed for a while, then exit,
    unless another takes the vehicle up with `token`. world: None for an empty sky.
    """

    vehicle: VehicleSettings = Field(default_factory=VehicleSettings)
    seed: int = Field(1, ge=0)
    speed: float = Field(1.0, gt=0, le=50)
    links: tuple[LinkSettings, ...] = (LinkSettings(),)
    truth_port: int = Field(0, ge=0, le=65535)
    folder: Path | None = None
    watch_parent: bool = False
    parent_pid: int | None = None
    orphan_s: float = Field(120.0, ge=0)
    token: str = ""
    world: Surroundings | None = None
