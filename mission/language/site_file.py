"""Where the turbine stands as surveyed, seen from the take-off point: `sites/*.yaml`."""

from __future__ import annotations

from pydantic import Field

from mission.language.file_model import Degrees, FileModel


class SiteFile(FileModel):
    """Place and heading of the turbine relative to home, and how far they may be off."""

    name: str = Field(min_length=1, max_length=80, description="What the team calls the place.")
    turbine_north_m: float = Field(ge=-2000, le=2000, description="The tower's axis, north of home.")
    turbine_east_m: float = Field(ge=-2000, le=2000, description="The tower's axis, east of home.")
    turbine_heading_deg: Degrees = Field(
        description="Direction from the front through the hub to the back, clockwise from north."
    )
    ground_m: float = Field(0.0, ge=-300, le=300, description="Ground at the tower's foot, above home.")
    position_sigma_m: float = Field(2.0, ge=0, le=20, description="Uncertainty of the surveyed place.")
    heading_sigma_deg: float = Field(5.0, ge=0, le=45, description="Uncertainty of the heading.")
