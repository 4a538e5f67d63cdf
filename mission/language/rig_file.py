"""What flies and what looks: vehicle connection, cameras, laser, gimbal: `rigs/*.yaml`."""

from __future__ import annotations

import difflib
import re
from typing import Annotated, Literal

from pydantic import Field, model_validator

from devices.camera_drivers import DRIVERS
from mission.language.file_model import Degrees, FileModel, Near


class CameraSection(FileModel):
    """A stereo pair of equal cameras side by side; a calibrated pair is given as `camchain:` instead."""

    width: int = Field(ge=64, le=10000, description="Pixels across.")
    height: int = Field(ge=64, le=10000, description="Pixels down.")
    focal_px: float = Field(gt=10, le=50000, description="Focal length in pixels.")
    baseline_m: float = Field(gt=0.005, le=5, description="Distance between the lenses.")
    distortion: tuple[float, float, float, float] = Field(
        (0.0, 0.0, 0.0, 0.0), description="Radial-tangential distortion k1, k2, p1, p2, as Kalibr and OpenCV write it."
    )


class LaserSection(FileModel):
    """The laser that throws a grid of dots."""

    rows: int = Field(11, ge=2, le=101, description="Dots from top to bottom.")
    columns: int = Field(11, ge=2, le=101, description="Dots from left to right.")
    fan_deg: float = Field(28.2, gt=1, le=120, description="Full angle of the grid, across and down.")
    position_m: tuple[Near, Near, Near] = Field(
        (0.0, 0.0, 0.0), description="In the left camera's frame: forward, right, down."
    )
    rotation_deg: tuple[Degrees, Degrees, Degrees] = Field(
        (0.0, 0.0, 0.0), description="Roll, pitch, yaw of the laser's axes in the left camera's frame."
    )


class RigFile(FileModel):
    """One rig. `kind` chooses the driver; the rest is geometry and how to reach the vehicle."""

    kind: Literal["simulated", "px4_sitl", "recorded", "hardware"] = Field(
        description="simulated: embedded simulator. px4_sitl: images drawn from the pose that PX4 SITL reports. "
        "recorded: images from a run's folder. hardware: a real vehicle."
    )
    system: str = Field(
        "embedded",
        pattern=r"^(embedded|(udpin|udpout|udp|tcpin|tcpout|tcp|serial)://\S+)$",
        description="embedded, or a MAVSDK connection such as udpin://0.0.0.0:14540.",
    )
    speed: float = Field(
        1.0, gt=0, le=100, description="Mission seconds per wall second; only a simulator can be faster."
    )
    mount_m: tuple[Near, Near, Near] = Field(
        (0.0, 0.0, 0.0), description="The left lens in body axes: forward, right, down."
    )
    camera: CameraSection | None = Field(None, description="The stereo pair by its data sheet.")
    camchain: str | None = Field(None, description="The stereo pair as calibrated: a Kalibr camchain beside this file.")
    bayer: Literal["rggb", "bggr", "grbg", "gbrg"] | None = Field(
        None,
        description="Images with one channel are the raw mosaic of colour cameras: its first pixels, row by row. "
        "None: they are grey.",
    )
    laser: LaserSection | None = Field(None, description="None: a rig without structured light.")
    gimbal: Literal["autopilot", "in_process"] = Field(
        "autopilot", description="autopilot: its gimbal manager. in_process: a gimbal simulated beside the cameras."
    )
    gimbal_pitch_deg: tuple[Degrees, Degrees] = Field((-90.0, 60.0), description="Lowest and highest pitch it reaches.")
    frames: str | None = Field(None, description="Folder of the recorded frames, beside this file; only kind recorded.")
    camera_driver: str | None = Field(
        None,
        json_schema_extra={"enum": [*DRIVERS, None]},
        description="Who takes the pictures of kind hardware: "
        + ". ".join(f"{name}: {driver.text}" for name, driver in DRIVERS.items())
        + ".",
    )
    sources: tuple[int | str, ...] = Field(
        (), description="The left and the right camera for its driver: numbers, devices, files or addresses."
    )
    parameters: dict[str, Annotated[float, Field(ge=-1e6, le=1e6)]] = Field(
        default_factory=dict,
        description="Parameters that a simulated autopilot is given; COM_OF_LOSS_T in wall seconds.",
    )
    confirm_arming: bool | None = Field(
        None, description="Ask before arming; by default for kind hardware, serial lines and other machines."
    )

    @model_validator(mode="after")
    def _consistent(self) -> RigFile:
        blind = self.camera_driver == "none" and self.camera is None and self.camchain is None
        if not blind and (self.camera is None) == (self.camchain is None):
            raise ValueError("give exactly one of camera and camchain")
        if self.system == "embedded" and self.kind in ("px4_sitl", "hardware"):
            raise ValueError(f"kind {self.kind} needs system: a MAVSDK connection such as udpin://0.0.0.0:14540")
        if (self.frames is None) == (self.kind == "recorded"):
            raise ValueError("frames belongs to kind recorded, and recorded needs it")
        if self.speed != 1.0 and self.kind == "hardware":
            raise ValueError("speed must be 1 for real hardware")
        if self.parameters and self.kind not in ("simulated", "px4_sitl"):
            raise ValueError(f"parameters are for simulated autopilots: set those of kind {self.kind} in a GCS")
        for name in self.parameters:
            if hint := _unknown_parameter(name, simulated=self.kind == "simulated"):
                raise ValueError(f"{name} is no parameter of the autopilot{hint}")
        if self.camera_driver is not None and self.kind != "hardware":
            raise ValueError("camera_driver belongs to kind hardware")
        if self.camera_driver is not None and self.camera_driver not in DRIVERS:
            raise ValueError(f"camera_driver {self.camera_driver!r}: choose one of {', '.join(DRIVERS)}")
        if len(self.sources) != (2 if self.camera_driver == "opencv" else 0):
            raise ValueError("sources names two cameras, left and right, for a camera_driver that opens them")
        return self


def _unknown_parameter(name: str, *, simulated: bool) -> str:
    """What to say about a parameter's name; empty where it may be right. PX4 has more than the simulated vehicle."""
    from devices.vehicle.parameters import DEFAULTS

    if name in DEFAULTS:
        return ""
    near = difflib.get_close_matches(name, DEFAULTS, n=1, cutoff=0.85)
    if near:
        return f": did you mean {near[0]}?"
    px4 = re.fullmatch(r"[A-Z][A-Z0-9_]{1,15}", name)
    return (
        ""
        if px4 and not simulated
        else f", which has {', '.join(list(DEFAULTS)[:6])}, …"
        if simulated
        else ": PX4 writes them as COM_OF_LOSS_T"
    )
