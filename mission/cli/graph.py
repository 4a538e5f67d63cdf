"""Draw a mission: SVG or Mermaid, and where a run went."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Format(StrEnum):
    """How it is drawn."""

    SVG = "svg"
    MERMAID = "mermaid"


def graph(
    file: Annotated[Path | None, typer.Argument(help="The mission; with --run, the one that was flown.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File to write; without it, the output.")] = None,
    form: Annotated[
        Format | None, typer.Option("--format", help="By default from the file's ending, else svg.")
    ] = None,
    run: Annotated[
        Path | None, typer.Option(metavar="RUN", help="Paint where this run went: its folder, name or `latest`.")
    ] = None,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where runs leave their folders.")] = Path("logs"),
    changes: Annotated[list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Override a value.")] = None,
) -> None:
    """Draw a mission's states and transitions on one page.

    Blue is the way to completion, red what safety events do, dashed what the operator does. Every way into a state
    shares one line.

    \b
    Examples:
      mission graph missions/v80_blade.yaml -o v80_blade.svg
      mission graph missions/v80_blade.yaml --format mermaid
      mission graph --run logs/20261121T101500Z-v80_blade -o flown.svg
    """
    from mission.cli.errors import CommandError
    from mission.language.document import load
    from mission.record.folder import open_run

    if file is None and run is None:
        raise CommandError("graph: name a mission file, or a run with --run")
    flown = open_run(run, record) if run is not None else None
    mission = load(file if file is not None else flown.mission, changes or ())  # type: ignore[union-attr]
    chosen = form or (Format.MERMAID if out is not None and out.suffix in (".mmd", ".mermaid", ".md") else Format.SVG)
    if chosen is Format.MERMAID:
        from mission.language.diagram.mermaid import mermaid

        text = mermaid(mission)
    else:
        from mission.language.diagram.painting import painting
        from mission.language.diagram.svg import svg

        text = svg(mission, painting(mission, flown.path) if flown is not None else None)
    if out is None:
        print(text, end="")
    else:
        out.write_text(text, "utf-8")
        print(f"{out}: {len(mission.states)} states, {len(mission.transitions())} transitions")
