"""Accuracy of the eye over generated scenes, as tables beside the figures that are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from devices.scenes import draw_scene, random_settings
from devices.scenes.settings import VIEWS, SceneSettings
from tests.bench.judge import Verdict, judge
from vision.pipeline import Eye

BIN_DEG = 15


def settings_of(count: int, first_seed: int, motion: bool = False) -> Iterable[SceneSettings]:
    """Scenes of every view at angles spread evenly over the circle."""
    for k in range(count):
        seed = first_seed + k
        angle = np.deg2rad((k * 137.50776) % 360)
        yield random_settings(seed, view=VIEWS[k % len(VIEWS)], angle=float(angle), motion=motion)


def measure(scenes: Iterable[SceneSettings], told: Callable[[str], None] = lambda line: None) -> list[Verdict]:
    """Draw, observe and judge scenes one by one; what goes wrong is told."""
    verdicts = []
    for settings in scenes:
        scene = draw_scene(settings)
        verdict = judge(scene, Eye(scene.geometry).observe(scene.frames))
        verdicts.append(verdict)
        if verdict.unsaid or not verdict.edges_right:
            told(f"  seed {settings.seed} {settings.view} {settings.background}: edges {verdict.edge_errors}, "
                 f"{verdict.edges_due} due, depth {verdict.depth_error}")  # fmt: skip
    return verdicts


def table(title: str, verdicts: Sequence[Verdict]) -> list[str]:
    """What was measured beside what is asked for."""
    total = lambda name: sum(getattr(v, name) for v in verdicts)  # noqa: E731
    depth = np.array([v.depth_error for v in verdicts if v.depth_error is not None])
    z = np.array([v.depth_z for v in verdicts if v.depth_z is not None])
    dot = np.array([error for v in verdicts for error in v.dot_px])
    edge_z = np.array([pair for v in verdicts for pair in v.edge_z]).reshape(-1, 2)
    two = [v for v in verdicts if v.view == "two_edges"]
    one = [v for v in verdicts if v.view in ("one_edge", "wrong_side")]
    tips = np.array([v.tip_m for v in verdicts if v.tip_m is not None])
    heading = [v.heading_deg is not None and v.heading_deg < 2 for v in two]
    no_tip = [v.false_tip for v in verdicts if v.tip_m is None]
    rows = [
        ("dots found / right", f"{total('dots_found') / max(total('dots_true'), 1):.4f} / "
         f"{1 - total('dots_wrong') / max(total('dots_reported'), 1):.4f}", "0.97 / 0.99"),
        ("dot centre, px RMS of 2448", f"{_rms(dot):.2f}", "0.40"),
        ("matches right", f"{1 - total('matches_wrong') / max(total('matches'), 1):.5f}", "0.999"),
        ("distance, median / 95 % error",
         f"{_quantile(np.abs(depth), 0.5):.2%} / {_quantile(np.abs(depth), 0.95):.2%}", ""),
        ("distance over its sigma, RMS / robust", f"{_rms(z):.2f} / {1.48 * _quantile(np.abs(z), 0.5):.2f}", "1"),
        ("two edges within 1°, 8 px", _share([v.edges_right for v in two]), "0.98"),
        ("  worst bin of 15°", _worst_bin(two), "0.98"),
        ("heading within 2°", _share(heading), "0.99"),
        ("one edge within 1°, 8 px", _share([v.edges_right for v in one]), "0.98"),
        ("edge over its sigma, θ / ρ, robust",
         f"{1.48 * _quantile(edge_z[:, 0], 0.5):.2f} / {1.48 * _quantile(edge_z[:, 1], 0.5):.2f}", "1"),
        ("tip within 5 cm", _share([bool(abs(t) < 0.05) for t in tips]), "0.97"),
        ("false tips", _share(no_tip), "0.003"),
        ("wrong without saying so", _share([v.unsaid for v in verdicts]), "0.001"),
        ("refused", _share([not v.valid for v in verdicts]), ""),
    ]  # fmt: skip
    lines = [f"{title}: {len(verdicts)} scenes", f"  {'what':<40}{'measured':>22}{'asked for':>14}"]
    return lines + [f"  {what:<40}{measured:>22}{asked:>14}" for what, measured, asked in rows]


def plot(verdicts: Sequence[Verdict], folder: Path) -> None:
    """Edges by angle and errors of distance against their claimed sigma, as pictures in a folder."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
    bins = np.arange(0, 360, BIN_DEG)
    share = [np.mean([v.edges_right for v in group]) if group else np.nan for group in _binned(verdicts)]
    left.bar(bins, share, BIN_DEG * 0.9, align="edge")
    left.axhline(0.98, color="black", linewidth=0.8)
    left.set(
        xlabel="direction of the blade, degrees", ylabel="share with every edge within 1° and 8 px", ylim=(0, 1.02)
    )
    z = [v.depth_z for v in verdicts if v.depth_z is not None]
    right.hist(np.clip(z, -5, 5), bins=41, density=True)
    x = np.linspace(-5, 5, 200)
    right.plot(x, np.exp(-x * x / 2) / np.sqrt(2 * np.pi), color="black", linewidth=0.8)
    right.set(xlabel="error of the distance over its claimed sigma")
    figure.tight_layout()
    figure.savefig(folder / "accuracy.png", dpi=110)
    plt.close(figure)


def _binned(verdicts: Sequence[Verdict]) -> list[list[Verdict]]:
    groups: list[list[Verdict]] = [[] for _ in range(360 // BIN_DEG)]
    for verdict in verdicts:
        groups[int(verdict.angle_deg % 360 // BIN_DEG)].append(verdict)
    return groups


def _worst_bin(verdicts: Sequence[Verdict]) -> str:
    shares = [float(np.mean([v.edges_right for v in group])) for group in _binned(verdicts) if group]
    return f"{min(shares):.3f}" if shares else "–"


def _share(values: Sequence[bool]) -> str:
    return f"{np.mean(values):.4f} of {len(values)}" if len(values) else "–"


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")


def _quantile(values: np.ndarray, share: float) -> float:
    return float(np.quantile(values, share)) if len(values) else float("nan")
