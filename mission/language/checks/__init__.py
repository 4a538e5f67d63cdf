"""Checks of the machine as a whole: one module each. Names and types are already known to be right."""

from __future__ import annotations

from mission.language.checks.check import check

__all__ = ["check"]
