"""How a running mission is doing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer


def status(
    run: Annotated[Path | None, typer.Argument(help="The run's folder or name; without it the one that flies.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything as one JSON document.")] = False,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
) -> None:
    """Print the state, its deadline, what may come next and what blocks it.

    \b
    Examples:
      mission status
      mission status --json
    """
    import json

    from mission.cli.command import reach

    answer = reach("status", run, record)
    print(json.dumps(dict(answer.status), indent=2) if as_json else "\n".join(_lines(answer.status)))


def _lines(status: dict[str, Any] | Any) -> list[str]:
    now = status["now_s"]
    deadline = status["deadline_s"]
    left = "" if deadline is None else f", {max(deadline - now, 0.0):.0f} s left"
    lines = [f"{status['mission']}: {status['path']} for {now - status['entered_s']:.0f} s{left}"]
    if status["text"]:
        lines.append(f"  {status['text']}")
    if status["station_m"] is not None:
        lines.append(f"  {status['station_m']:.1f} m along the blade")
    if status["waiting"]:
        lines.append(f"  waits for an answer: {status['waiting']}  (mission step, or mission step --no)")
    if status["journal_error"]:
        lines.append(f"  {status['journal_error']}")
    for entry in status["next"]:
        blocked = f"  [{entry['blocked']}]" if entry["blocked"] else ""
        lines.append(f"  {entry['event']} → {entry['target']}{blocked}")
    return lines
