"""Measure the eye and print it; text and plots go to logs/bench."""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

from tests.bench import accuracy, drawn, plots, speed

ROOT = Path(__file__).parents[2]


def main() -> int:
    """Speed and accuracy of the eye over generated scenes with known truth."""
    parser = argparse.ArgumentParser(prog="make bench ARGS=…", description=main.__doc__)
    parser.add_argument("--scenes", type=int, default=240, help="for the accuracy table; the others have as they need")
    parser.add_argument("--seed", type=int, default=1000, help="first seed")
    parser.add_argument("--out", type=Path, default=ROOT / "logs" / "bench")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="processes for the accuracy")
    parser.add_argument("--no-speed", action="store_true")
    parser.add_argument("--wall", action="store_true", help="speed by the clock on the wall, not by the processor's")
    parser.add_argument("--verbose", action="store_true", help="name every scene that went wrong")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    lines: list[str] = []

    def say(more: list[str]) -> None:
        lines.extend([*more, ""])
        print("\n".join([*more, ""]), flush=True)

    speeds: list[speed.Speed] = []
    if not options.no_speed:
        speeds = speed.measure(time.perf_counter if options.wall else time.process_time)
        say(speed.table(speeds, "wall" if options.wall else "processor"))
    told = (lambda line: print(line, flush=True)) if options.verbose else (lambda line: None)
    seed, few = options.seed, max(1, options.scenes // 48)
    still = drawn.measure(drawn.settings_of(options.scenes, seed), told, options.jobs)
    say(accuracy.table("accuracy, every brightness, baseline, background and distance", still))
    moving = drawn.measure(drawn.settings_of(options.scenes // 4, seed + 100_000, motion=True), told, options.jobs)
    say(accuracy.table("accuracy, 5 to 30 px of motion between laser-off and laser-on", moving, recall=0.95))
    bins = drawn.measure(drawn.in_bins(few, seed + 200_000), told, options.jobs)
    say(accuracy.bin_table(bins))
    depth = drawn.measure(drawn.at_three_metres(4 * few, seed + 300_000), told, options.jobs)
    say(accuracy.depth_table(depth))
    pictures = plots.draw(options.out, [*still, *moving], bins, depth, speeds)
    (options.out / "bench.txt").write_text("\n".join(lines))
    print(f"{options.out}/bench.txt, {', '.join(path.name for path in pictures)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
