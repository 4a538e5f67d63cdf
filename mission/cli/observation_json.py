"""What was observed as JSON: angles in degrees, pixels of the full image, metres in the camera frame."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vision.observation import BladeObservation, Dots, Edge, Tip


def as_json(seen: BladeObservation) -> str:
    """One line of JSON; what is not known is null, never NaN."""
    return json.dumps(_finite(as_document(seen)), allow_nan=False)


def as_document(seen: BladeObservation) -> dict[str, Any]:
    """The keys that `mission observe --json` prints."""
    return {
        "valid": seen.valid,
        "reasons": list(seen.reasons),
        "dots": {"left": _dots(seen.dots_left), "right": _dots(seen.dots_right)},
        "matches": _matches(seen),
        "points_m": _listed(seen.points) or [],
        "sigma_m": _listed(seen.sigma_m) or [],
        "distance_m": seen.distance_m,
        "distance_sigma_m": seen.distance_sigma_m,
        "nearest_m": seen.nearest_m,
        "normal": _listed(seen.normal),
        "edges": [_edge(edge) for edge in seen.edges],
        "tip": None if seen.tip is None else _tip(seen.tip),
        "heading_deg": _degrees(seen.heading),
        "heading_sigma_deg": _degrees(seen.heading_sigma),
        "chord_m": seen.chord_m,
        "chord_sigma_m": seen.chord_sigma_m,
        "sharpness": seen.sharpness,
        "exposure": seen.exposure,
        "elapsed_ms": dict(seen.elapsed_ms),
    }


def _dots(dots: Dots | None) -> list[dict[str, Any]]:
    if dots is None:
        return []
    return [
        {"u": float(u), "v": float(v), "row": int(row), "column": int(column)}
        for (u, v), row, column in zip(dots.uv, dots.row, dots.column, strict=True)
    ]


def _matches(seen: BladeObservation) -> list[dict[str, Any]]:
    """Row and column of each dot that both eyes saw, and which of `dots.left` and `dots.right` it is."""
    if seen.matches is None:
        return []
    sides = []
    for dots in (seen.dots_left, seen.dots_right):
        pairs = [] if dots is None else zip(dots.row.tolist(), dots.column.tolist(), strict=True)
        sides.append({pair: index for index, pair in enumerate(pairs)})
    return [
        {"row": r, "column": c, "left": sides[0].get((r, c)), "right": sides[1].get((r, c))}
        for r, c in seen.matches.tolist()
    ]


def _edge(edge: Edge) -> dict[str, Any]:
    return {
        "theta_deg": _degrees(edge.line.theta),
        "rho_px": edge.line.rho,
        "sigma_theta_deg": _degrees(edge.sigma_theta),
        "sigma_rho_px": edge.sigma_rho_px,
        "outward": _listed(edge.outward),
        "support": edge.support,
        "ends_px": _listed(edge.ends),
    }


def _tip(tip: Tip) -> dict[str, Any]:
    return {
        "theta_deg": _degrees(tip.line.theta),
        "rho_px": tip.line.rho,
        "point_px": _listed(tip.point),
        "sigma_px": tip.sigma_px,
    }


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


def _listed(array: Any) -> list[Any] | None:
    return None if array is None else list(array.astype(float).tolist())


def _finite(value: Any) -> Any:
    """The same with plain numbers, and null where a number is not finite."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_finite(entry) for entry in value]
    if value is None or isinstance(value, bool | int | str):
        return value
    return float(value) if math.isfinite(value) else None
