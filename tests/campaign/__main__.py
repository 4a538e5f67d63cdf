"""Fly the campaign with the command that a user types, and print what each flight reached."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

from tests.campaign import kills
from tests.campaign.flights import FLIGHTS, Flight, shortfalls

ROOT = Path(__file__).parents[2]
ROW = "{:<22}{:<11}{:>5}{:>8}{:>8}{:>8}{:>9}{:>8}{:>8}  {}"


def fly(flight: Flight, mission: str, record: Path, extra: list[str]) -> tuple[int, dict[str, object], float]:
    """Exit code, summary and wall seconds of one flight."""
    record.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "mission", "run", mission, "--headless", "--record", str(record), *extra]
    for setting in flight.settings:
        command += ["--set", setting]
    started = time.monotonic()
    with (record / "output.txt").open("w") as output:
        code = subprocess.run(command, cwd=ROOT, stdout=output, stderr=subprocess.STDOUT, check=False).returncode
    runs = sorted(record.glob("*/summary.json"))
    summary = json.loads(runs[-1].read_text()) if runs else {}
    return code, summary, time.monotonic() - started


def main() -> int:
    """Fly those flights whose names contain one of the words given; all by default."""
    parser = argparse.ArgumentParser(prog="make campaign ARGS=…", description=main.__doc__)
    parser.add_argument("words", nargs="*", help="`kill N`: kill the program at N random instants instead")
    parser.add_argument("--seed", type=int, default=1, help="of the instants")
    parser.add_argument("--flight", type=float, default=60.0, help="wall seconds over which they are spread")
    parser.add_argument("--mission", default="missions/v80_blade.yaml")
    parser.add_argument("--record", type=Path, default=ROOT / "logs" / "campaign")
    parser.add_argument("--lockstep", action="store_true")
    parser.add_argument("--speed", type=float)
    options = parser.parse_args()
    if options.words[:1] == ["kill"]:
        number = int(options.words[1]) if len(options.words) > 1 else 100
        speed = ["--speed", str(options.speed)] if options.speed else []
        return 1 if kills.campaign(number, options.seed, options.flight, options.record / "kills", *speed) else 0
    extra = ["--lockstep"] if options.lockstep else []
    extra += ["--speed", str(options.speed)] if options.speed else []
    chosen = [f for f in FLIGHTS if not options.words or any(word in f.name for word in options.words)]
    print(ROW.format("flight", "outcome", "wall", "x", "clear", "rmse", "tip", "lead", "trail", "missed"))
    missed_any = False
    for flight in chosen:
        folder = options.record / time.strftime("%H%M%S-") / flight.name.replace(" ", "_")
        code, summary, wall = fly(flight, options.mission, folder, extra)
        truth: dict[str, object] = summary.get("truth") or {}  # type: ignore[assignment]
        coverage: dict[str, object] = truth.get("coverage") or {}  # type: ignore[assignment]
        missed = shortfalls(flight, code, summary)
        missed_any |= bool(missed)
        cells = [
            summary.get("outcome"),
            round(wall),
            summary.get("speed_factor"),
            truth.get("min_clearance_m"),
            truth.get("standoff_rmse_m"),
            truth.get("tip_error_m"),
            coverage.get("leading"),
            coverage.get("trailing"),
            "; ".join(missed) or "nothing",
        ]
        print(ROW.format(flight.name, *("-" if cell is None else str(cell) for cell in cells)), flush=True)
    return 1 if missed_any else 0


if __name__ == "__main__":
    sys.exit(main())
