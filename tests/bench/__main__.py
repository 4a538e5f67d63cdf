"""Measure the eye and print it; text and plots go to logs/bench."""

from __future__ import annotations

import argparse
from pathlib import Path

from tests.bench import accuracy, speed

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Speed and accuracy of the eye over generated scenes with known truth."""
    parser = argparse.ArgumentParser(prog="make bench ARGS=…", description=main.__doc__)
    parser.add_argument(
        "--scenes", type=int, default=240, help="scenes for the accuracy table (a quarter of each view)"
    )
    parser.add_argument("--seed", type=int, default=1000, help="first seed")
    parser.add_argument("--out", type=Path, default=ROOT / "logs" / "bench")
    parser.add_argument("--no-speed", action="store_true")
    parser.add_argument("--verbose", action="store_true", help="name every scene that went wrong")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    lines: list[str] = []

    def say(more: list[str]) -> None:
        lines.extend([*more, ""])
        print("\n".join([*more, ""]), flush=True)

    told = (lambda line: print(line, flush=True)) if options.verbose else (lambda line: None)
    if not options.no_speed:
        say(speed.table())
    still = accuracy.measure(accuracy.settings_of(options.scenes, options.seed), told)
    say(accuracy.table("accuracy, every brightness, baseline, background and distance", still))
    moving = accuracy.measure(accuracy.settings_of(options.scenes // 4, options.seed + 100_000, motion=True), told)
    say(accuracy.table("accuracy, 5 to 30 px of motion between laser-off and laser-on", moving))
    accuracy.plot(still, options.out)
    (options.out / "bench.txt").write_text("\n".join(lines))
    print(f"{options.out}/bench.txt, {options.out}/accuracy.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
