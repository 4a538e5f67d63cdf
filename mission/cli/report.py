"""Rebuild a run's summary and page from its record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from mission.record.folder import RunFolder


def report(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="The run's folder, its name below logs, or `latest`.")],
    logs: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
    as_json: Annotated[bool, typer.Option("--json", help="Print summary.json.")] = False,
) -> None:
    """Write a run's summary.json and report.html again, from what it recorded. It works for a run that was killed, too.

    \b
    Examples:
      mission report latest
      mission report logs/20261121T101500Z-v80_blade --json
    """
    from mission.record.folder import open_run

    folder = open_run(run, logs)
    summary = rebuild(folder)
    if as_json:
        print(json.dumps(summary, indent=1))
        return
    for line in told(folder, summary):
        print(line)


def rebuild(folder: RunFolder) -> Mapping[str, Any]:
    """Compute the summary, write it and the page, and return it."""
    from mission.record.report import write_report
    from mission.record.summary import write_summary

    summary = write_summary(folder)
    write_report(folder, summary)
    return summary


def told(folder: RunFolder, summary: Mapping[str, Any]) -> list[str]:
    """What a person reads at the end of a run."""
    faster = f", {summary['speed_factor']:.1f} × real time" if summary.get("speed_factor") else ""
    lines = [
        f"{summary['outcome']}  {summary['mission']}  {summary['duration_s']:.0f} s of flight{faster}",
        *_measured(summary),
        f"  record    {folder.path}",
        f"  report    {folder.report}",
    ]
    if summary["continues"]:
        lines.insert(1, f"  goes on   with {', '.join(summary['continues'])}")
    if summary["outcome"] in ("unfinished", "aborted"):
        lines.append(f"  go on     mission run --resume {folder.path}")
    if summary["outcome"] != "completed" and summary.get("why"):
        lines.insert(1, f"  because   {summary['why']}")
    return lines


def _measured(summary: Mapping[str, Any]) -> list[str]:
    lines = []
    standoff, truth = summary["standoff"], summary.get("truth") or {}
    if standoff.get("rmse_m") is not None:
        true = f" (truth {truth['standoff_rmse_m']:.2f} m)" if truth.get("standoff_rmse_m") is not None else ""
        lines.append(
            f"  standoff  {standoff['target_m']:g} m ± {standoff['rmse_m']:.2f} m{true}, "
            f"{standoff['min_m']:.2f} to {standoff['max_m']:.2f} m"
        )
    if summary["coverage"]:
        shares = ", ".join(f"{side} {100 * share:.0f} %" for side, share in summary["coverage"].items())
        if "blades" in summary:
            sides = [[f"{100 * share:.0f}" for share in one["coverage"].values()] for one in summary["blades"]]
            each = ", ".join(" and ".join(side) or "nothing" for side in sides)
            shares += f" (blade by blade {each} %)"
        lines.append(f"  coverage  {shares}, {summary['frames']} frames")
    if summary["tip"]["found"]:
        error = f", {truth['tip_error_m']:.2f} m off in truth" if truth.get("tip_error_m") is not None else ""
        lines.append(f"  tip       at {summary['tip']['radius_m']:.2f} m from the hub{error}")
    if truth.get("min_clearance_m") is not None:
        lines.append(f"  clearance never under {truth['min_clearance_m']:.2f} m in truth")
    return lines
