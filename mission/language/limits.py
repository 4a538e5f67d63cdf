"""The limits that the monitors watch; a state may narrow or widen them for itself and all below."""

from __future__ import annotations

from pydantic import Field, model_validator

from mission.language.file_model import FileModel


class Limits(FileModel):
    """Where a monitor raises its event. A state's own `limits:` are merged over those around it."""

    clearance_m: float = Field(2.0, gt=0, le=100, description="Nearest allowed surface; nearer raises too_close.")
    standoff_error_m: float = Field(
        1.0, gt=0, le=20, description="Allowed difference from the wanted distance to the blade; more: standoff_lost."
    )
    wind_m_s: float = Field(14.0, gt=0, le=40, description="Mean wind; above it wind_high is raised.")
    battery_percent: float = Field(25.0, ge=0, le=100, description="Charge below which battery_low is raised.")
    battery_critical_percent: float = Field(
        12.0, ge=0, le=100, description="Charge below which battery_critical is raised."
    )
    vision_bridge_s: float = Field(
        3.0, gt=0, le=60, description="Longest time without an accepted observation that is bridged; then vision_lost."
    )
    vision_sigma_m: float = Field(
        0.6, gt=0, le=10, description="Standard deviation of the tracked distance beyond which vision_lost is raised."
    )
    link_s: float = Field(1.0, gt=0, le=60, description="Silence of the autopilot after which link_lost is raised.")
    geofence_m: float = Field(
        150.0, gt=0, le=10000, description="Distance from home beyond which geofence_breached is raised."
    )
    position_sigma_m: float = Field(
        5.0, gt=0, le=100, description="Uncertainty of the position, as the autopilot claims it; above it gps_degraded."
    )

    @model_validator(mode="after")
    def _consistent(self) -> Limits:
        if self.battery_critical_percent >= self.battery_percent:
            raise ValueError("battery_critical_percent must be below battery_percent")
        return self
