"""What was photographed and found of each blade: a mission may take all of a turbine in turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from devices.recorded_mission import states_of
from mission.record.coverage import SHARP, share
from mission.record.history import RunHistory


def blades_of(history: RunHistory) -> Sequence[Mapping[str, Any]]:
    """Each blade that was to be inspected, or was, in its turn; a single one for most missions."""
    wanted = 1
    if any(state.get("do") == "next_blade" for _, state in states_of(history.mission)):
        wanted = history.parameters_of("next_blade").get("blades", 3)
    numbers = range(max([wanted, *(line["blade"] + 1 for line in history.frames)]))
    known: dict[int, Mapping[str, Any]] = {}
    for turn in history.turns:
        known |= turn.found
    return [
        {
            "coverage": _coverage(history, number),
            "tip": found(known.get(number, {}).get("tip_station_m")),
            "root": found(known.get(number, {}).get("root_station_m")),
        }
        for number in numbers
    ]


def together(blades: Sequence[Mapping[str, Any]]) -> Mapping[str, float]:
    """Coverage of each side over all blades: one that was never flown counts as nothing."""
    sides = sorted({side for blade in blades for side in blade["coverage"]})
    return {side: sum(blade["coverage"].get(side, 0.0) for blade in blades) / len(blades) for side in sides}


def _coverage(history: RunHistory, blade: int) -> Mapping[str, float]:
    """Share of the span whose edge of that side was in a recorded, sharp, accepted frame, as the program believes."""
    turbine = history.mission.get("turbine") or {}
    root_m = turbine.get("root_radius_m")
    if root_m is None or turbine.get("blade_length_m") is None:
        return {}
    seen: dict[str, list[tuple[float, float]]] = {}
    for line in history.frames:
        if line["side"] not in ("leading", "trailing") or line["blade"] != blade:
            continue
        stretches = seen.setdefault(str(line["side"]), [])
        if line.get("accepted") and (line.get("sharpness") or 0.0) >= SHARP and line.get("edge_m"):
            stretches.append((line["edge_m"][0], line["edge_m"][1]))
    tip_m = root_m + turbine["blade_length_m"]
    return {side: share(stretches, root_m, tip_m) for side, stretches in seen.items()}


def found(station_m: float | None) -> Mapping[str, Any]:
    """A landmark of the summary."""
    return {"found": station_m is not None, "radius_m": station_m}
