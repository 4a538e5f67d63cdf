"""What a user may say about the simulated world: the `world:` section of a mission or rig file."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


Share = Annotated[float, Field(ge=0, le=1)]
Degrees = Annotated[float, Field(ge=-360, le=360)]


class Wind(_Section):
    """Wind at hub height: a steady part and gusts on top of it."""

    mean_m_s: float = Field(3.0, ge=0, le=40, description="Steady wind speed.")
    gust_m_s: float = Field(4.0, ge=0, le=60, description="Speed that the strongest gusts reach; below mean_m_s: none.")
    from_deg: Degrees = Field(200.0, description="Direction that the wind comes from, clockwise from north.")


class SurveyError(_Section):
    """By how much the true turbine differs from the site and turbine files: true = as surveyed + error."""

    distance_m: float = Field(0.0, ge=0, le=20, description="How far the true tower stands from the surveyed place.")
    bearing_deg: Degrees = Field(0.0, description="In which direction it stands from there, clockwise from north.")
    heading_deg: float = Field(0.0, ge=-45, le=45, description="Added to the turbine's heading.")
    azimuth_deg: float = Field(0.0, ge=-30, le=30, description="Added to the azimuth of the inspected blade.")


class Gps(_Section):
    """How the position that the autopilot believes differs from the true one."""

    offset_north_m: float = Field(0.0, ge=-20, le=20, description="Constant error, north.")
    offset_east_m: float = Field(0.0, ge=-20, le=20, description="Constant error, east.")
    offset_down_m: float = Field(0.0, ge=-20, le=20, description="Constant error, down.")
    drift_m_min: float = Field(0.15, ge=0, le=10, description="Random walk of each axis: sigma after a minute.")
    noise_m: float = Field(0.01, ge=0, le=2, description="Jitter of the estimate on each axis, sigma.")


class Light(_Section):
    """Sun, sky and how bright the blade is painted."""

    sun_azimuth_deg: Degrees = Field(215.0, description="Where the sun stands, clockwise from north.")
    sun_elevation_deg: float = Field(38.0, ge=0, le=90, description="How high it stands.")
    ambient: Share = Field(0.62, description="Share of the light that comes from the sky rather than the sun.")
    blade_brightness: float = Field(185.0, ge=0, le=255, description="Grey value of the lit, clean blade.")
    background: str = Field("fields", pattern="^(fields|sea|plain)$", description="Ground: fields, sea, or plain grey.")
    clouds: Share = Field(0.5, description="How cloudy the sky is.")


class Lens(_Section):
    """The cameras' sensor and shutter."""

    noise: float = Field(1.5, ge=0, le=30, description="Sensor noise, standard deviation in grey values.")
    exposure: float = Field(1.0, gt=0, le=8, description="Factor on every brightness; above 1 saturates.")
    motion_blur: Share = Field(0.02, description="Exposure time as a share of the time between two frames; 0 freezes.")
    colour: bool = Field(True, description="BGR images; grey ones where false.")
    frame_gap_s: float = Field(0.0286, ge=0, le=1, description="Time between the laser-off and the laser-on exposure.")
    antialias: bool = Field(True, description="Smooth silhouettes, as a real lens does; false is faster.")
    streak_px: float = Field(
        1.0, ge=0, le=40, description="Length of the laser's spots beyond their height, of 612 px."
    )
    vignette: Share = Field(0.12, description="Share of the light that is lost in the image corners.")


class Surface(_Section):
    """What the weather did to the blade."""

    dirt: Share = Field(0.35, description="Amount of dirt and streaks.")
    cracks: int = Field(4, ge=0, le=50, description="Number of cracks on each blade.")


class Vehicle(_Section):
    """The simulated aircraft."""

    battery_percent: float = Field(98.0, ge=0, le=100, description="Charge at the start.")
    battery_minutes: float = Field(22.0, gt=0, le=1000, description="Flight time of a full battery.")
    gimbal_lag_s: float = Field(0.12, ge=0, le=5, description="Time constant of the gimbal's answer.")
    gimbal_rate_deg_s: float = Field(90.0, gt=0, le=1000, description="Fastest turn of the gimbal.")


class Window(_Section):
    """When a fault is on: from `at_s`, or `after_s` after `state` is first entered, for `for_s`; or the last `for_s` of
    every `every_s`, counted from there. With nothing said of when, from the start of the mission."""

    at_s: float | None = Field(None, ge=0, description="Mission seconds at which it begins.")
    state: str | None = Field(None, description="Path of a state (or of one around it) whose first entry arms it.")
    after_s: float = Field(0.0, ge=0, description="Seconds after that entry.")
    for_s: float | None = Field(2.0, gt=0, description="How long it lasts; null: until the end.")
    every_s: float | None = Field(None, gt=0, description="Period with which it comes back.")

    @model_validator(mode="after")
    def _consistent(self) -> Window:
        if self.at_s is not None and self.state is not None:
            raise ValueError("give at_s or state, not both")
        if self.every_s is not None and (self.for_s is None or self.for_s >= self.every_s):
            raise ValueError("for_s must be shorter than every_s")
        return self


class Lasting(Window):
    """A fault that, once there, stays unless `for_s` says otherwise."""

    for_s: float | None = Field(None, gt=0, description="How long it lasts; null: until the end.")


class GpsJump(Lasting):
    """The estimated position jumps, as after a change of satellites."""

    north_m: float = Field(2.0, ge=-50, le=50, description="Jump north.")
    east_m: float = Field(0.0, ge=-50, le=50, description="Jump east.")
    down_m: float = Field(0.0, ge=-50, le=50, description="Jump down.")


class BatteryDrop(Lasting):
    """The battery falls to a level, as an old cell does."""

    percent: float = Field(20.0, ge=0, le=100, description="Level that it falls to at most.")


class Gust(Window):
    """One more gust on top of the wind."""

    for_s: float | None = Field(5.0, gt=0, description="How long it lasts; null: until the end.")
    speed_m_s: float = Field(8.0, ge=0, le=60, description="Added wind speed.")
    from_deg: Degrees | None = Field(None, description="Where it comes from; null: as the wind.")


class Blocked(Window):
    """The executive's event loop hangs: rehearses the dead-man rule."""

    for_s: float | None = Field(3.0, gt=0, le=60, description="How long it hangs.")


class Faults(_Section):
    """Faults that a user can rehearse; off unless given. `--set world.faults.images.every_s=20` switches one on."""

    images: Window | None = Field(None, description="No images at all.")
    blackout: Window | None = Field(None, description="No images at all; a second switch beside `images`.")
    left_eye: Lasting | None = Field(None, description="The left camera delivers nothing.")
    right_eye: Lasting | None = Field(None, description="The right camera delivers nothing.")
    laser_off: Lasting | None = Field(None, description="The laser stays dark.")
    range_finder: Lasting | None = Field(None, description="The range finder falls silent.")
    gps_jump: GpsJump | None = Field(None, description="The estimated position jumps.")
    battery: BatteryDrop | None = Field(None, description="The battery falls to a level.")
    link: Window | None = Field(None, description="Nothing passes between vehicle and companion computer.")
    gimbal_stuck: Lasting | None = Field(None, description="The gimbal stays where it is.")
    gust: Gust | None = Field(None, description="One more gust.")
    executive_blocked: Blocked | None = Field(None, description="The executive's event loop hangs.")


class WorldSettings(_Section):
    """The simulated world beside the turbine itself."""

    seed: int = Field(1, ge=0, lt=2**31, description="One seed, one world: noise, gusts, drift, dirt.")
    wind: Wind = Field(default_factory=Wind)
    survey_error: SurveyError = Field(default_factory=SurveyError)
    gps: Gps = Field(default_factory=Gps)
    light: Light = Field(default_factory=Light)
    camera: Lens = Field(default_factory=Lens)
    blade: Surface = Field(default_factory=Surface)
    vehicle: Vehicle = Field(default_factory=Vehicle)
    faults: Faults = Field(default_factory=Faults)
