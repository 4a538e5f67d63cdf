"""Draws what was seen into the image it was seen in."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vision.capture import Image
from vision.observation import BladeObservation

Array = NDArray[Any]  # of floats

DOT, EDGE, TIP, TEXT = (0, 220, 255), (40, 40, 235), (230, 60, 230), (255, 255, 255)  # BGR
SMALLEST = 600  # px of width; a smaller image is enlarged so that the drawing can be read


def annotated(image: Image, seen: BladeObservation) -> Image:
    """A copy (h, w, 3) of the left laser-on image with dots, edges, their outward sides, tip, distance and reasons."""
    height, width = image.shape[:2]
    zoom = max(1, -(-SMALLEST // width))
    canvas = cv2.resize(image, (width * zoom, height * zoom), interpolation=cv2.INTER_NEAREST)
    if canvas.ndim == 2:
        canvas = cv2.cvtColor(canvas, cv2.COLOR_GRAY2BGR)
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    unit = max(1, round(canvas.shape[1] / 612))

    def at(point: Array) -> tuple[int, int]:
        u, v = np.rint((point + 0.5) * zoom - 0.5).astype(int).tolist()
        return u, v

    if seen.dots_left is not None:
        for uv, row, column in zip(seen.dots_left.uv, seen.dots_left.row, seen.dots_left.column, strict=True):
            cv2.circle(canvas, at(uv), 5 * unit, DOT, unit, cv2.LINE_AA)
            if row == column or row == 0 or column == 0:
                cv2.putText(canvas, f"{row},{column}", at(uv + 6 * unit / zoom), 0, 0.28 * unit, DOT, unit, cv2.LINE_AA)
    for edge in seen.edges:
        cv2.line(canvas, at(edge.ends[0] + centre), at(edge.ends[1] + centre), EDGE, 2 * unit, cv2.LINE_AA)
        middle = edge.ends.mean(axis=0) + centre
        cv2.arrowedLine(canvas, at(middle), at(middle + 24 * unit / zoom * edge.outward), EDGE, 2 * unit, cv2.LINE_AA)
    if seen.tip is not None:
        normal = np.array([np.cos(seen.tip.line.theta), np.sin(seen.tip.line.theta)])
        foot = seen.tip.point + normal * (seen.tip.line.rho - float(seen.tip.point @ normal))
        reach = 30 * unit / zoom * np.array([-normal[1], normal[0]])
        cv2.line(canvas, at(foot - reach + centre), at(foot + reach + centre), TIP, 2 * unit, cv2.LINE_AA)
        cv2.circle(canvas, at(seen.tip.point + centre), 8 * unit, TIP, 2 * unit, cv2.LINE_AA)
    for line, text in enumerate(_lines(seen)):
        place = (8 * unit, (18 + 18 * line) * unit)
        (wide, high), below = cv2.getTextSize(text, 0, 0.45 * unit, unit)
        corner, opposite = (place[0] - 4 * unit, place[1] - high - 3 * unit), (place[0] + wide, place[1] + below)
        cv2.rectangle(canvas, corner, opposite, (0, 0, 0), cv2.FILLED)
        cv2.putText(canvas, text, place, 0, 0.45 * unit, TEXT, unit, cv2.LINE_AA)
    return np.asarray(canvas, np.uint8)


def _lines(seen: BladeObservation) -> list[str]:
    told = []
    if seen.distance_m is not None and seen.distance_sigma_m is not None and seen.nearest_m is not None:
        told.append(f"{seen.distance_m:.3f} +- {seen.distance_sigma_m:.3f} m, nearest {seen.nearest_m:.2f} m")
    if seen.heading is not None:
        chord = f", chord {seen.chord_m:.2f} m" if seen.chord_m is not None else ""
        told.append(f"heading {np.rad2deg(seen.heading):.1f} deg{chord}")
    return told + [
        ("" if seen.valid else "refused: ") + reason.encode("ascii", "replace").decode() for reason in seen.reasons
    ]
