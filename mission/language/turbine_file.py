"""The turbine's shape as its data sheet gives it: `turbines/*.yaml`."""

from __future__ import annotations

from pydantic import Field, model_validator

from mission.language.file_model import Degrees, FileModel


class TurbineFile(FileModel):
    """A three-bladed horizontal-axis turbine. Azimuths run clockwise as seen from the front, 0 = pointing up."""

    name: str = Field(min_length=1, max_length=80, description="Maker and type.")
    hub_height_m: float = Field(gt=5, le=300, description="Hub centre above the ground.")
    blade_length_m: float = Field(gt=1, le=200, description="From the blade's root to its tip.")
    root_radius_m: float = Field(gt=0, le=10, description="From the hub's centre to where the blade begins.")
    root_diameter_m: float = Field(gt=0.1, le=10, description="Of the cylindrical root.")
    max_chord_m: float = Field(gt=0.1, le=15, description="Largest chord.")
    tip_chord_m: float = Field(gt=0.01, le=5, description="Chord where the rounding of the tip begins.")
    blades: int = Field(3, ge=1, le=6, description="Number of blades, evenly spaced.")
    tilt_deg: float = Field(5.0, ge=-10, le=15, description="Of the rotor axis, nose up.")
    cone_deg: float = Field(2.0, ge=-10, le=15, description="Of the blades, toward the wind.")
    overhang_m: float = Field(4.2, ge=0, le=20, description="From the tower's axis to the hub's centre.")
    tower_top_diameter_m: float = Field(gt=0.3, le=12, description="Of the tower just below the nacelle.")
    tower_base_diameter_m: float = Field(gt=0.3, le=20, description="Of the tower at the ground.")
    nacelle_length_m: float = Field(gt=0.5, le=40, description="Along the rotor axis.")
    nacelle_width_m: float = Field(gt=0.5, le=15, description="Across; taken for its height too.")
    azimuth_deg: Degrees = Field(0.0, description="Of the blade to inspect: clockwise from the front, 0 = pointing up.")
    pitch_deg: float = Field(0.0, ge=-10, le=95, description="Of the blades; 0 = flat to the wind, 90 = feathered.")

    @model_validator(mode="after")
    def _consistent(self) -> TurbineFile:
        if self.tip_chord_m > self.max_chord_m:
            raise ValueError("tip_chord_m must not be larger than max_chord_m")
        if self.hub_height_m <= self.blade_length_m + self.root_radius_m:
            raise ValueError(
                "hub_height_m must be larger than blade_length_m + root_radius_m: the tip clears the ground"
            )
        return self

    @property
    def tip_radius_m(self) -> float:
        """From the hub's centre to the tip."""
        return self.root_radius_m + self.blade_length_m
