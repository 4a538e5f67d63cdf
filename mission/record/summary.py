"""A run in numbers: summary.json, computed from the run's files alone."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mission.record.blades import blades_of, found, together
from mission.record.consistency import consistency_of
from mission.record.folder import RunFolder
from mission.record.history import RunHistory
from mission.record.row_file import plain

UNWATCHED_S = 5.0
"""A silence of vision longer than this means that nobody watched: while somebody does, missing images are lines too."""


def write_summary(folder: RunFolder) -> Mapping[str, Any]:
    """Compute the summary and replace summary.json by it in one step."""
    summary = summarise(RunHistory(folder))
    draft = folder.summary.with_suffix(".part")
    draft.write_text(json.dumps(summary, indent=1, ensure_ascii=False) + "\n", "utf-8")
    draft.replace(folder.summary)
    return summary


def summarise(history: RunHistory) -> Mapping[str, Any]:
    """The summary of a run, finished or not."""
    duration_s, wall_s = history.duration_s, history.wall_s
    end = history.end or {}
    last = history.visits[-1].state if history.visits else None
    blades = blades_of(history)
    summary: dict[str, Any] = {
        "mission": history.mission.get("mission"),
        "run": history.folder.name,
        "continues": [part.name for part in history.parts[:-1]],
        "outcome": end.get("outcome", "unfinished"),
        "final_state": end.get("state", last),
        "why": _why(history),
        "simulated": history.simulated,
        "duration_s": duration_s,
        "wall_s": wall_s,
        "speed_factor": duration_s / wall_s if wall_s else None,
        "states": [
            {"state": visit.state, "entered_s": visit.entered_s, "left_s": visit.left_s, "by": visit.by}
            for visit in history.visits
        ],
        "standoff": _standoff(history),
        "coverage": together(blades),
        "tip": found(history.memory.get("tip_station_m")),
        "root": found(history.memory.get("root_station_m")),
        "vision": _vision(history.cycles),
        "tracker": consistency_of(history),
        "frames": len(history.frames),
        "setpoints": _setpoints(history.setpoints),
    }
    if len(blades) > 1:
        summary["blades"] = blades
    if any(part.truth.is_file() for part in history.parts):
        summary["truth"] = _truth(history)
    result: Mapping[str, Any] = plain(summary)
    return result


def _why(history: RunHistory) -> str | None:
    """What ended a run that did not reach a final state, else the event that first led out of the inspection and what
    was said with it; None for a completed run."""
    if (history.end or {}).get("outcome") == "completed":
        return None
    if (history.end or {}).get("why"):
        return str((history.end or {})["why"])
    said: Mapping[str, Any] = {}
    for line in history.journals[-1]:
        if line["kind"] == "event":
            said = line
        elif line["kind"] == "transition" and str(line["to"]).partition(".")[0] in (
            "abort",
            "aborted",
            "refused",
            "released",
        ):
            data = said.get("data") or {}
            reason = data.get("reason") or data.get("error") or data.get("text")
            where = f"in {line['from']}"
            return f"{line['event']} {where}: {reason}" if reason else f"{line['event']} {where}"
    return None


def _standoff(history: RunHistory) -> Mapping[str, float | None]:
    """The estimated distance to the blade while its edges were being followed, held against the wanted one."""
    target = history.parameters_of("follow_edge").get("standoff_m")
    if target is None:
        target = (history.mission.get("parameters") or {}).get("standoff_m")
    kept = np.array(
        [
            line["estimate"]["distance_m"]
            for line in history.cycles
            if line.get("side") and (line.get("estimate") or {}).get("distance_m") is not None
        ],
        float,
    )
    if target is None or not len(kept):
        return {"target_m": target, "rmse_m": None, "min_m": None, "max_m": None}
    return {
        "target_m": float(target),
        "rmse_m": float(np.sqrt(np.mean((kept - float(target)) ** 2))),
        "min_m": float(kept.min()),
        "max_m": float(kept.max()),
    }


def _vision(cycles: Sequence[Mapping[str, Any]]) -> Mapping[str, float | None]:
    accepted = sum(bool(line.get("accepted")) for line in cycles)
    elapsed = [line["elapsed_ms"] for line in cycles if line.get("elapsed_ms") is not None]
    return {
        "cycles": len(cycles),
        "accepted": accepted,
        "bridged": len(cycles) - accepted,
        "longest_gap_s": _longest_gap(cycles),
        "p50_ms": float(np.percentile(elapsed, 50)) if elapsed else None,
        "p99_ms": float(np.percentile(elapsed, 99)) if elapsed else None,
    }


def _longest_gap(cycles: Iterable[Mapping[str, Any]]) -> float | None:
    """Longest time between two accepted cycles, or from one to the end of the watch."""
    longest, since, before = None, None, None
    for line in cycles:
        stamp = line.get("stamp")
        if stamp is None:
            continue
        if before is None or stamp - before > UNWATCHED_S:
            since = None
        before = stamp
        if since is not None:
            longest = max(longest or 0.0, stamp - since)
        if line.get("accepted"):
            since = stamp
    return longest


def _setpoints(rows: Sequence[Mapping[str, str]]) -> Mapping[str, float | None]:
    """Rate on the wall's clock and the longest gap within a stream."""
    if len(rows) < 2:
        return {"sent": len(rows), "rate_hz": None, "longest_gap_ms": None}
    wall = np.array([float(row["wall_s"]) for row in rows])
    first = np.array([row.get("first") == "1" for row in rows])
    gaps = np.diff(wall)[~first[1:]]
    total = float(gaps.sum())
    return {
        "sent": len(rows),
        "rate_hz": len(gaps) / total if total > 0 else None,
        "longest_gap_ms": 1000.0 * float(gaps.max()) if len(gaps) else None,
    }


def _truth(history: RunHistory) -> Mapping[str, Any] | None:
    """What the simulated world knows of the run; None where too little of it was recorded."""
    from devices.world.truth import truth_of_run

    try:
        return truth_of_run(*(part.path for part in history.parts))
    except (ValueError, KeyError, TypeError, IndexError):
        return None  # torn files of a killed run
