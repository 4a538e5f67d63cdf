"""Prove that every safety event leads to a safe end."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def prove(
    files: Annotated[list[Path], typer.Argument(help="Mission files.")],
    traces: Annotated[bool, typer.Option("--traces", help="Show the longest way of every event.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
    changes: Annotated[list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help="Override a value.")] = None,
    rig: Annotated[str | None, typer.Option(help="Another rig file.")] = None,
) -> None:
    """Explore every situation × every event and show that each safety event leads to a safe end, in how many steps.

    Guards are taken as free: whatever they say, the property must hold. Where it does not, the shortest counterexample
    is printed as a trace. `never:` and `always_eventually:` of the mission are proven as well.

    \b
    Examples:
      mission prove missions/v80_blade.yaml
      mission prove missions/*.yaml --traces

    Exit code 1 where a property does not hold, 2 where a file cannot be read.
    """
    from mission.language.diagnostics import MissionFileError
    from mission.language.loading import examine
    from mission.language.proof import prove as proven
    from mission.language.proof_text import data, shown

    proofs = []
    for file in files:
        examination = examine(file, changes or (), rig, checked=False)
        if examination.mission is None:
            raise MissionFileError(examination.errors)
        proofs.append(proven(examination.mission))
    if as_json:
        import json

        print(json.dumps([data(proof) for proof in proofs], indent=2, ensure_ascii=False))
    else:
        for proof in proofs:
            print(shown(proof, traces))
    if not all(proof.holds for proof in proofs):
        raise typer.Exit(1)
