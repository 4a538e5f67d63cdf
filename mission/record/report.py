"""The run as one page that needs nothing else: report.html."""

from __future__ import annotations

import base64
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from mission.record.coverage import SHARP
from mission.record.folder import RunFolder
from mission.record.history import RunHistory
from mission.record.plots import Series, Span, blade_map, over_time, timeline
from mission.record.track import views

THUMBS = 12
"""Photographs shown of each side; the page links to the files."""
THUMB_PX = 180


def write_report(folder: RunFolder, summary: Mapping[str, Any]) -> Path:
    """Draw the page from the run's files and its summary, and replace report.html by it in one step."""
    history = RunHistory(folder)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=jinja2.StrictUndefined
    )
    page = environment.get_template("report.html").render(
        summary=summary,
        when=_when(summary["run"]),
        duration=f"{int(summary['duration_s']) // 60}:{int(summary['duration_s']) % 60:02d} min",
        cards=_cards(summary),
        views=[Markup(view) for view in views(history)],
        timeline=Markup(timeline(_spans(summary))),
        standoff=Markup(_standoff(history, summary)),
        sides=[
            _side(folder, history, number, side, covered, several="blades" in summary)
            for number, blade in enumerate(summary.get("blades", [summary]))
            for side, covered in blade["coverage"].items()
        ],
        vision=_vision(summary),
        reasons=_reasons(history),
        events=_events(history),
    )
    draft = folder.report.with_suffix(".part")
    draft.write_text(page, "utf-8")
    draft.replace(folder.report)
    return folder.report


def _when(run: str) -> str:
    try:
        return datetime.strptime(run.partition("Z-")[0], "%Y%m%dT%H%M%S").strftime("%-d %B %Y, %H:%M UTC")
    except ValueError:
        return run


def _cards(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    standoff, vision, truth = summary["standoff"], summary["vision"], summary.get("truth") or {}
    rows = [
        ("standoff RMSE, estimated", _metres(standoff["rmse_m"])),
        ("standoff RMSE, truth", _metres(truth.get("standoff_rmse_m"))),
        ("least clearance, truth", _metres(truth.get("min_clearance_m"))),
        *((f"of {_of_blades(summary, side)}", _percent(share)) for side, share in summary["coverage"].items()),
        ("tip error, truth", _metres(truth.get("tip_error_m"))),
        ("photographs", str(summary["frames"])),
        ("vision cycle, median", f"{vision['p50_ms']:.0f} ms" if vision["p50_ms"] is not None else None),
        ("longest gap of vision", _seconds(vision["longest_gap_s"])),
    ]
    return [{"name": name, "value": value} for name, value in rows if value is not None]


def _metres(value: float | None) -> str | None:
    return None if value is None else f"{value:.2f} m"


def _seconds(value: float | None) -> str | None:
    return None if value is None else f"{value:.1f} s"


def _percent(share: float | None) -> str | None:
    return None if share is None else f"{100 * share:.1f} %"


def _spans(summary: Mapping[str, Any]) -> list[Span]:
    spans = []
    end_s = max((state["left_s"] or state["entered_s"] for state in summary["states"]), default=0.0)
    for state in summary["states"]:
        left_s = state["left_s"] if state["left_s"] is not None else end_s
        text = f"{state['state']}: {left_s - state['entered_s']:.1f} s, left by {state['by'] or 'the end'}"
        spans.append(Span(state["state"], state["entered_s"], left_s, text))
    return spans


def _standoff(history: RunHistory, summary: Mapping[str, Any]) -> str:
    """The tracked distance while a side was recorded; the line breaks where nothing came for two seconds."""
    distance: list[tuple[float, float | None]] = []
    nearest: list[tuple[float, float | None]] = []
    bands: list[list[tuple[float, float, float]]] = [[]]
    for line in history.cycles:
        estimate = line.get("estimate") or {}
        if not line.get("side") or estimate.get("distance_m") is None:
            continue
        at, metres, sigma = line["stamp"], estimate["distance_m"], estimate.get("sigma_m") or 0.0
        if distance and at - distance[-1][0] > 2.0:
            for series in (distance, nearest):
                series.append((at, None))
            bands.append([])
        distance.append((at, metres))
        nearest.append((at, estimate.get("nearest_m")))
        bands[-1].append((at, metres - 2 * sigma, metres + 2 * sigma))
    target = summary["standoff"]["target_m"]
    rules = [target] if target is not None else []
    return over_time([Series("nearest", nearest), Series("distance", distance)], unit=" m", bands=bands, rules=rules)


def _of_blades(summary: Mapping[str, Any], side: str) -> str:
    blades = len(summary.get("blades", ()))
    return f"the {side} edges, {blades} blades" if blades else f"the {side} edge"


def _side(
    folder: RunFolder, history: RunHistory, blade: int, side: str, covered: float, *, several: bool
) -> dict[str, Any]:
    turbine = history.mission["turbine"]
    root_m = turbine["root_radius_m"]
    frames = [line for line in history.frames if line["side"] == side and line["blade"] == blade]
    stretches = [(*line["edge_m"], "covered") for line in frames if _counts(line)]
    marks = [
        (line["station_m"], "taken" if _counts(line) else "refused", f"{line['file']} at {line['station_m']:.1f} m")
        for line in frames
        if line.get("station_m") is not None
    ]
    return {
        "name": f"blade {blade + 1}, {side}" if several else side,
        "count": len(frames),
        "covered": f"{_percent(covered)} of the edge",
        "map": Markup(blade_map(stretches, marks, root_m, root_m + turbine["blade_length_m"])),
        "thumbs": _thumbs(folder, frames),
    }


def _counts(line: Mapping[str, Any]) -> bool:
    return bool(line.get("accepted") and (line.get("sharpness") or 0.0) >= SHARP and line.get("edge_m"))


def _thumbs(folder: RunFolder, frames: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """A few photographs evenly spread from root to tip, small, inside the page."""
    import cv2

    placed = sorted((line for line in frames if line.get("station_m") is not None), key=lambda line: line["station_m"])
    chosen = [placed[round(i * (len(placed) - 1) / (THUMBS - 1))] for i in range(THUMBS)] if placed else []
    thumbs = []
    for line in {line["path"]: line for line in chosen}.values():
        image = cv2.imread(str(folder.path / line["path"]))
        if image is None:
            continue
        height = max(1, round(image.shape[0] * THUMB_PX / image.shape[1]))
        small = cv2.resize(image, (THUMB_PX, height), interpolation=cv2.INTER_AREA)
        data = base64.b64encode(cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes()).decode()
        scale = f", {line['mm_per_px']:.1f} mm/px" if line.get("mm_per_px") is not None else ""
        text = f"{line['station_m']:.1f} m{scale}"
        thumbs.append({"path": line["path"], "data": f"data:image/jpeg;base64,{data}", "text": text})
    return thumbs


def _vision(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    vision, setpoints = summary["vision"], summary["setpoints"]
    rows: list[tuple[str, str | None]] = [
        ("cycles", str(vision["cycles"])),
        ("accepted", str(vision["accepted"])),
        ("bridged", str(vision["bridged"])),
        ("longest gap", _seconds(vision["longest_gap_s"])),
        ("median of a cycle", _milliseconds(vision["p50_ms"])),
        ("99 % of cycles under", _milliseconds(vision["p99_ms"])),
        *_claims(summary.get("tracker") or {}),
        ("setpoints sent", str(setpoints["sent"])),
        ("setpoints a wall second", f"{setpoints['rate_hz']:.1f}" if setpoints["rate_hz"] is not None else None),
        ("longest gap between setpoints", _milliseconds(setpoints["longest_gap_ms"])),
    ]
    return [(name, value) for name, value in rows if value is not None]


def _claims(tracker: Mapping[str, Any]) -> list[tuple[str, str | None]]:
    """How well the tracker's claims held."""
    ratio, interval = tracker.get("nis_per_dof"), tracker.get("interval")
    rows: list[tuple[str, str | None]] = []
    if ratio is not None and interval is not None:
        rows.append(("innovations squared, of those claimed", f"{ratio:.2f} ({interval[0]:.2f} to {interval[1]:.2f})"))
    for name, text in (("following", "distance within 1σ, 2σ of truth"), ("bridging", "the same while bridging")):
        covered = (tracker.get("distance") or {}).get(name)
        if covered is not None:
            shares = f"{_percent(covered['within_1_sigma'])}, {_percent(covered['within_2_sigma'])}"
            rows.append((text, f"{shares} (σ {1000 * covered['sigma_m']:.0f} mm)"))
    return rows


def _milliseconds(value: float | None) -> str | None:
    return None if value is None else f"{value:.1f} ms"


def _reasons(history: RunHistory) -> list[tuple[str, int]]:
    """Why cycles were refused, most frequent first; reasons that differ in their numbers alone are one."""
    counted = Counter(
        re.sub(r"[-+]?\d+(?:\.\d+)?", "…", reason)
        for line in history.cycles
        if not line.get("accepted")
        for reason in line.get("reasons") or ()
    )
    return counted.most_common(10)


def _events(history: RunHistory) -> list[dict[str, Any]]:
    from mission.record.follower import told

    return [{"t": line["t"], "text": text} for line in history.journal if (text := told(line))]
