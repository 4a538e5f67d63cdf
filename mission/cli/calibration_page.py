"""A calibration's report as one page to open in a browser: what was found, warnings, errors by view, coverage."""

from __future__ import annotations

import base64
import math
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vision.calibration import StereoFit

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1c2530; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.5rem } h2 { font-size: 1.1rem; margin-top: 2rem }
pre { background: #f4f6f8; padding: 1rem; overflow-x: auto; font-size: 13px }
.warnings { background: #fff3d6; border-left: 4px solid #d08700; padding: .6rem 1rem }
.fine { background: #e4f4e8; border-left: 4px solid #2b8a3e; padding: .6rem 1rem }
.warnings ul { margin: .3rem 0 0; padding-left: 1.2rem }
figure { margin: 0 } figcaption { color: #5a6672; font-size: 13px } img { max-width: 100% }
.bars { display: flex; gap: 2rem; flex-wrap: wrap }
"""
WIDE, HIGH, BASE = 300, 130, 120


def page(fit: StereoFit, text: str, coverage_png: bytes) -> str:
    """The page's HTML. text: the report in words. coverage_png: the picture of where corners were."""
    picture = base64.b64encode(coverage_png).decode()
    errors = {
        "left camera": {view.name: view.left_px for view in fit.views},
        "right camera": {view.name: view.right_px for view in fit.views},
        "both held together": {view.name: view.together_px for view in fit.views},
    }
    bars = "".join(_bars(name, by_view) for name, by_view in errors.items())
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Calibration</title><style>{STYLE}</style></head><body>
<h1>Calibration of the stereo cameras</h1>
{_warnings(fit)}
<p>Reprojection {fit.rms_px:.3f} px, epipolar residual {fit.epipolar_px:.3f} px, baseline
{fit.stereo.baseline_m * 1000:.2f} mm; the fit is <b>{fit.chosen}</b>.</p>
<h2>Reprojection error by view</h2><div class="bars">{bars}</div>
<h2>Where the corners were</h2>
<figure><img alt="coverage of both images" src="data:image/png;base64,{picture}">
<figcaption>Left and right image. Shaded: cells with corners. Red: each corner's error, a hundredfold.</figcaption>
</figure>
<h2>In numbers</h2><pre>{escape(text)}</pre>
</body></html>
"""


def _warnings(fit: StereoFit) -> str:
    if not fit.warnings:
        return '<p class="fine">The data carry what was fitted.</p>'
    items = "".join(f"<li>{escape(warning)}</li>" for warning in fit.warnings)
    return f'<div class="warnings"><b>Read before use</b><ul>{items}</ul></div>'


def _bars(name: str, by_view: dict[str, float]) -> str:
    """Root mean square error of each view in px, as bars on the scale of the worst one; NaN: no bar."""
    counted = [error for error in by_view.values() if math.isfinite(error)]
    largest = max([*counted, 1e-9])
    step = WIDE / len(by_view)
    drawn = "".join(
        f'<rect x="{k * step + 1:.1f}" y="{BASE - 100 * error / largest:.1f}" width="{max(step - 2, 1):.1f}" '
        f'height="{100 * error / largest:.1f}" fill="#3b6ea5"><title>{escape(view)}: {error:.3f} px</title></rect>'
        for k, (view, error) in enumerate(by_view.items())
        if math.isfinite(error)
    )
    return (
        f'<figure><svg width="{WIDE}" height="{HIGH}" role="img" aria-label="{name}">'
        f'<text x="0" y="12" font-size="12">{largest:.2f} px</text>{drawn}'
        f'<line x1="0" y1="{BASE}" x2="{WIDE}" y2="{BASE}" stroke="#1c2530"/></svg>'
        f"<figcaption>{name}, {len(counted)} of {len(by_view)} views</figcaption></figure>"
    )
