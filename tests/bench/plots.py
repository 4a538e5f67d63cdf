"""Pictures of what was measured: angles, errors against claimed sigmas, depth, speed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.bench.accuracy import POINT_SIGMA_M, binned, points_of, share_right
from tests.bench.drawn import BASELINES_M, BIN_DEG
from tests.bench.judge import Verdict
from tests.bench.speed import STAGES, Speed

INK, GOOD, BAD, QUIET = "#26323d", "#2a7f8e", "#d1603d", "#c9d3da"
STAGE_COLOURS = ("#1f4e5f", "#2a7f8e", "#5aa9a1", "#a3cfbf", "#e9a23b", "#d1603d", "#8d99a6")
STYLE = {
    "font.size": 9, "axes.edgecolor": QUIET, "axes.labelcolor": INK, "axes.titlecolor": INK, "text.color": INK,
    "xtick.color": INK, "ytick.color": INK, "axes.spines.top": False, "axes.spines.right": False,
    "axes.titlelocation": "left", "axes.titleweight": "bold", "axes.titlesize": 10, "figure.facecolor": "white",
    "legend.frameon": False,
}  # fmt: skip


def draw(
    folder: Path, general: Sequence[Verdict], bins: Sequence[Verdict], depth: Sequence[Verdict], speeds: Sequence[Speed]
) -> list[Path]:
    """accuracy.png and, where speed was measured, speed.png."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    drawn = []
    with plt.rc_context(STYLE):
        figure = plt.figure(figsize=(12, 8.4), layout="constrained")
        places = figure.add_gridspec(2, 3, width_ratios=(1.25, 1, 1))
        _angles(figure.add_subplot(places[:, 0], projection="polar"), bins)
        everything = [*general, *bins, *depth]
        z = [v.depth_z for v in everything if v.depth_z is not None]
        _normalised(figure.add_subplot(places[0, 1]), "distance over its sigma", z)
        points = points_of(everything)
        _normalised(figure.add_subplot(places[0, 2]), "single points over their sigma", points[:, 0] / points[:, 1])
        _points(figure.add_subplot(places[1, 1]), depth)
        _edges(figure.add_subplot(places[1, 2]), everything)
        drawn.append(folder / "accuracy.png")
        figure.savefig(drawn[-1], dpi=120)
        plt.close(figure)
        if speeds:
            figure, axes = plt.subplots(figsize=(9, 0.7 + 0.75 * len(speeds)), layout="constrained")
            _speed(axes, speeds)
            drawn.append(folder / "speed.png")
            figure.savefig(drawn[-1], dpi=120)
            plt.close(figure)
    return drawn


def _angles(axes: Any, verdicts: Sequence[Verdict]) -> None:
    """Share of scenes with both edges right, around the circle as the camera sees the blade's direction."""
    groups = binned(verdicts)
    share = np.array([share_right(group) for group in groups])
    angle = np.deg2rad((np.arange(len(groups)) + 0.5) * BIN_DEG)
    colours = [GOOD if s >= 0.98 else BAD for s in share]
    axes.set_theta_direction(-1)  # clockwise from the right, as angles run in the image
    axes.bar(angle, share, np.deg2rad(BIN_DEG) * 0.92, color=colours)
    turn = np.linspace(0, 2 * np.pi, 400)
    axes.plot(turn, np.full(400, 0.98), color=INK, linewidth=0.8)
    axes.set_ylim(0, 1.0)
    axes.set_yticks([0.25, 0.5, 0.75], ["", "50 %", ""])
    axes.set_xticks(np.deg2rad(np.arange(0, 360, 45)))
    axes.grid(color=QUIET, linewidth=0.5)
    axes.spines["polar"].set_visible(False)
    axes.set_title(
        f"both edges within 1° and 8 px, by direction of the blade\n"
        f"{share_right(verdicts):.1%} of {len(verdicts)}; line: 98 %",
        pad=18,
    )


def _normalised(axes: Any, what: str, z: Any) -> None:
    """Histogram of errors over their claimed standard deviations beside the normal distribution."""
    z = np.asarray(z, float)
    axes.hist(np.clip(z, -5, 5), bins=np.linspace(-5, 5, 51), density=True, color=GOOD, alpha=0.85)
    x = np.linspace(-5, 5, 300)
    axes.plot(x, np.exp(-x * x / 2) / np.sqrt(2 * np.pi), color=INK, linewidth=1)
    within = float(np.mean(np.abs(z) < 2))
    axes.set(xlim=(-5, 5), yticks=[], title=what)
    axes.text(0.02, 0.95, f"{len(z)}\n{within:.1%} within 2 σ\n(normal: 95.4 %)", transform=axes.transAxes, va="top")
    axes.spines["left"].set_visible(False)


def _points(axes: Any, verdicts: Sequence[Verdict]) -> None:
    """Errors of single points at 3 m, by baseline, with the standard deviations that are asked for."""
    groups = [1e3 * points_of([v for v in verdicts if v.baseline_m == b])[:, 0] for b in BASELINES_M]
    spots = np.arange(len(groups))
    rng = np.random.default_rng(0)
    for k, errors in enumerate(groups):
        axes.plot(k + rng.uniform(-0.3, 0.3, len(errors)), errors, ",", color=GOOD, alpha=0.5)
        if len(errors):
            sigma = 1.4826 * float(np.median(np.abs(errors)))
            axes.errorbar(k, 0, sigma, color=INK, capsize=4, linewidth=1.2)
            axes.annotate(f"±{sigma:.0f}", (k, sigma), (6, 2), textcoords="offset points")
        asked = POINT_SIGMA_M.get(BASELINES_M[k])
        if asked is not None:
            axes.hlines([-1e3 * asked, 1e3 * asked], k - 0.4, k + 0.4, color=BAD, linewidth=1, linestyle="--")
    axes.set_xticks(spots, [f"{b:.2f} m" for b in BASELINES_M])
    axes.set(ylim=(-110, 110), ylabel="mm", title="depth of single points at 3 m, by baseline")
    axes.text(0.98, 0.02, "dashed: sigma asked for", transform=axes.transAxes, ha="right", color=BAD)


def _edges(axes: Any, verdicts: Sequence[Verdict]) -> None:
    """Errors of the edges that were found, in angle and offset."""
    errors = np.array([pair for v in verdicts for pair in v.edge_errors]).reshape(-1, 2).clip((1e-3, 1e-2), (180, 2e3))
    good = (errors[:, 0] < 1) & (errors[:, 1] < 8)
    axes.axvspan(1e-3, 1, 0, np.log(8 / 1e-2) / np.log(2e3 / 1e-2), color=QUIET, alpha=0.35, linewidth=0)
    axes.plot(*errors[good].T, ".", color=GOOD, markersize=2.5)
    axes.plot(*errors[~good].T, ".", color=BAD, markersize=5)
    axes.set(xscale="log", yscale="log", xlim=(9e-4, 180), ylim=(9e-3, 2e3), xlabel="degrees", ylabel="px of 2448")
    axes.set_title(f"errors of {len(errors)} edges, {np.count_nonzero(~good)} of them wrong")


def _speed(axes: Any, speeds: Sequence[Speed]) -> None:
    """Stages one after the other, with the floor and what is asked for."""
    for k, speed in enumerate(speeds):
        start = 0.0
        for stage, colour in zip(STAGES[:-1], STAGE_COLOURS, strict=True):
            axes.barh(k, speed.stages[stage], 0.55, start, color=colour, label=stage if k == 0 else None)
            start += speed.stages[stage]
        limit = speed.asked * (speed.floor_ms or 1.0)
        axes.vlines(limit, k - 0.38, k + 0.38, color=INK, linewidth=1.5)
        if speed.floor_ms is not None:
            axes.vlines(speed.floor_ms, k - 0.38, k + 0.38, color=INK, linewidth=1, linestyle=":")
        axes.annotate(f"{speed.stages['total']:.1f} ms", (max(start, limit), k), (5, -3), textcoords="offset points")
    axes.set_yticks(range(len(speeds)), [speed.name for speed in speeds])
    axes.invert_yaxis()
    axes.set(xlabel="milliseconds on one thread; line: asked for, dotted: the floor")
    axes.margins(x=0.12)
    axes.legend(ncols=len(STAGES), loc="upper center", bbox_to_anchor=(0.45, 1.0 + 0.5 / len(speeds)))
