"""The base of everything that pydantic reads from a file: frozen, nothing unknown, nothing infinite."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class FileModel(BaseModel):
    """Base of the files' models. Fields carry their unit in the name, their limits and their documentation."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


Degrees = Annotated[float, Field(ge=-360, le=360)]
Near = Annotated[float, Field(ge=-5, le=5)]
"""Metres between parts of one vehicle."""
