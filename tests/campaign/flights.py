"""The flights of the campaign, and what each must reach: a table that the campaign walks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Summary = Mapping[str, Any]


@dataclass(frozen=True)
class Bounds:
    """What a completed flight's truth must hold; None where it does not matter."""

    outcome: str = "completed"
    clearance_m: float = 2.0
    rmse_m: float | None = 0.20
    coverage: float | None = 0.95
    tip_m: float | None = 0.5


@dataclass(frozen=True)
class Flight:
    """One flight: a name, `--set` values, and its bounds."""

    name: str
    settings: tuple[str, ...] = ()
    bounds: Bounds = field(default_factory=Bounds)
    exit_code: int = 0


ABORTED = Bounds("aborted", rmse_m=None, coverage=None, tip_m=None)

FLIGHTS = (
    Flight("default"),
    *(Flight(f"azimuth {a}", (f"turbine.azimuth_deg={a}",)) for a in range(0, 360, 45)),
    Flight(
        "wind 8 gusts 12",
        ("world.wind.mean_m_s=8", "world.wind.gust_m_s=12"),
        Bounds(clearance_m=1.5, rmse_m=0.35),
    ),
    Flight(
        "no images 2 s in 20",
        ("world.faults.images.every_s=20", "world.faults.images.for_s=2"),
    ),
    Flight(
        "no images for 15 s",
        (
            "world.faults.blackout.state=inspect.blade.leading",
            "world.faults.blackout.after_s=15",
            "world.faults.blackout.for_s=15",
        ),
        ABORTED,
        1,
    ),
    Flight(
        "loop blocked 3 s",
        (
            "world.faults.executive_blocked.state=inspect.blade.leading",
            "world.faults.executive_blocked.after_s=15",
        ),
        Bounds(rmse_m=None, coverage=None, tip_m=None, outcome=""),
        -1,
    ),
)


def shortfalls(flight: Flight, code: int, summary: Summary) -> list[str]:
    """What a flight missed, in words; empty when it reached everything."""
    bounds, missed = flight.bounds, []
    truth: Mapping[str, Any] = summary.get("truth") or {}
    if flight.exit_code >= 0 and code != flight.exit_code:
        missed.append(f"exit {code}, wanted {flight.exit_code}")
    if bounds.outcome and summary.get("outcome") != bounds.outcome:
        missed.append(f"{summary.get('outcome')}, wanted {bounds.outcome}")
    clearance = truth.get("min_clearance_m")
    if clearance is None or clearance < bounds.clearance_m:
        missed.append(f"clearance {clearance}")
    rmse = truth.get("standoff_rmse_m")
    if bounds.rmse_m is not None and (rmse is None or rmse > bounds.rmse_m):
        missed.append(f"standoff {rmse}")
    for side in ("leading", "trailing"):
        share = (truth.get("coverage") or {}).get(side)
        if bounds.coverage is not None and (share is None or share < bounds.coverage):
            missed.append(f"{side} coverage {share}")
    tip = truth.get("tip_error_m")
    if bounds.tip_m is not None and (tip is None or abs(tip) > bounds.tip_m):
        missed.append(f"tip {tip}")
    return missed
