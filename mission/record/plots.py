"""The pictures of a report as inline SVG: coloured by the page's style sheet, with neither network nor script."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

WIDTH = 960
LEFT, RIGHT = 46, 14

Point = tuple[float, float]


@dataclass(frozen=True)
class Scale:
    """Values from `low` to `high` laid between two pixels."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        return self.start + (value - self.low) / ((self.high - self.low) or 1.0) * (self.end - self.start)

    def ticks(self, count: int = 6) -> list[float]:
        """Round values within, about so many."""
        span = self.high - self.low
        if span <= 0:
            return [self.low]
        raw = span / count
        step = 10 ** math.floor(math.log10(raw))
        step = min((factor * step for factor in (1, 2, 5, 10)), key=lambda candidate: abs(candidate - raw))
        first = math.ceil(self.low / step - 1e-9)
        return [number * step for number in range(first, math.floor(self.high / step + 1e-9) + 1)]


@dataclass(frozen=True)
class Span:
    """A stretch of time with a name: `state` colours it, `text` is shown when pointed at."""

    name: str
    start_s: float
    end_s: float
    text: str = ""


@dataclass(frozen=True)
class Series:
    """A line of (seconds, value); None breaks it. `kind` is a class of the style sheet."""

    kind: str
    points: Sequence[tuple[float, float | None]]


def timeline(spans: Sequence[Span]) -> str:
    """States over time, one row each in order of first entry."""
    if not spans:
        return ""
    names = list(dict.fromkeys(span.name for span in spans))
    row, left = 22, 190
    time = Scale(spans[0].start_s, max(span.end_s for span in spans), left, WIDTH - RIGHT)
    height = row * len(names) + 26
    parts = _grid_x(time, 4, height - 22)
    for index, name in enumerate(names):
        y = 4 + index * row
        parts.append(f'<text class="label" x="{left - 8}" y="{y + 15}" text-anchor="end">{escape(name)}</text>')
    for span in spans:
        y = 4 + names.index(span.name) * row
        width = max(time(span.end_s) - time(span.start_s), 1.5)
        parts.append(
            f'<rect class="bar {_tone(span.name)}" x="{time(span.start_s):.1f}" y="{y + 3}" width="{width:.1f}" '
            f'height="{row - 6}" rx="3"><title>{escape(span.text)}</title></rect>'
        )
    return _svg(height, parts)


def _tone(state: str) -> str:
    """Which of the style sheet's tones a state has: ordinary work, holding back, giving up."""
    words = state.replace("_", ".").split(".")
    if any(word.startswith("abort") or word in ("refused", "released") for word in words):
        return "bad"
    if any(word in ("search", "reacquire", "holding", "hold") for word in words):
        return "wary"
    return "good"


Band = Sequence[tuple[float, float, float]]


def over_time(series: Sequence[Series], *, unit: str, bands: Sequence[Band] = (), rules: Iterable[float] = ()) -> str:
    """Values over mission seconds, with bands of (seconds, low, high) behind and level lines."""
    values = [value for line in series for _, value in line.points if value is not None]
    values += [value for band in bands for _, *ends in band for value in ends]
    times = [at for line in series for at, _ in line.points]
    rules = list(rules)
    if not values:
        return ""
    low, high = min([*values, *rules]), max([*values, *rules])
    margin = 0.08 * (high - low) or 0.5
    height = 260
    time = Scale(min(times), max(times), LEFT, WIDTH - RIGHT)
    value = Scale(low - margin, high + margin, height - 26, 10)
    parts = _grid_x(time, 10, height - 26) + _grid_y(value, unit)
    for band in bands:
        upper = [(time(at), value(top)) for at, _, top in band]
        lower = [(time(at), value(bottom)) for at, bottom, _ in reversed(band)]
        parts.append(f'<polygon class="band" points="{_points([*upper, *lower])}"/>')
    for level in rules:
        parts.append(
            f'<line class="rule" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{value(level):.1f}" y2="{value(level):.1f}"/>'
        )
    for line in series:
        parts += [
            f'<polyline class="line {line.kind}" points="{_points(piece)}"/>' for piece in _pieces(line, time, value)
        ]
    return _svg(height, parts)


def blade_map(
    stretches: Sequence[tuple[float, float, str]], marks: Sequence[tuple[float, str, str]], root_m: float, tip_m: float
) -> str:
    """One side of the blade, root left and tip right. stretches: (from m, to m, class) of edge in a frame; marks:
    (station m, class, text) of each frame."""
    height, top, bottom = 96, 34, 62
    along = Scale(0.0, tip_m + 1.0, LEFT, WIDTH - RIGHT)
    middle = (top + bottom) / 2
    outline = [
        (along(root_m), middle - 7),
        (along(root_m + 0.2 * (tip_m - root_m)), top),
        (along(tip_m - 0.4), middle - 4),
        (along(tip_m), middle),
        (along(tip_m - 0.4), middle + 4),
        (along(root_m + 0.2 * (tip_m - root_m)), bottom),
        (along(root_m), middle + 7),
    ]
    parts = [f'<polygon class="blade" points="{_points(outline)}"/>']
    parts.append(
        f'<rect class="uncovered" x="{along(root_m):.1f}" y="72" '
        f'width="{along(tip_m) - along(root_m):.1f}" height="6"/>'
    )
    for start, end, kind in stretches:
        first, last = along(max(start, root_m)), along(min(end, tip_m))
        if last > first:
            parts.append(f'<rect class="{kind}" x="{first:.1f}" y="72" width="{last - first:.1f}" height="6"/>')
    for station, kind, text in marks:
        parts.append(
            f'<circle class="{kind}" cx="{along(station):.1f}" cy="20" r="3"><title>{escape(text)}</title></circle>'
        )
    parts += [
        f'<text class="tick" x="{along(tick):.1f}" y="92" text-anchor="middle">{tick:g} m</text>'
        for tick in along.ticks(8)
    ]
    return _svg(height, parts)


def _pieces(line: Series, time: Scale, value: Scale) -> list[list[Point]]:
    pieces: list[list[Point]] = [[]]
    for at, number in line.points:
        if number is None:
            pieces.append([])
        else:
            pieces[-1].append((time(at), value(number)))
    return [piece for piece in pieces if len(piece) > 1]


def _grid_x(time: Scale, top: float, bottom: float) -> list[str]:
    parts = []
    for tick in time.ticks(8):
        x = time(tick)
        parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{bottom}"/>')
        parts.append(f'<text class="tick" x="{x:.1f}" y="{bottom + 16}" text-anchor="middle">{tick:g} s</text>')
    return parts


def _grid_y(value: Scale, unit: str) -> list[str]:
    parts = []
    for tick in value.ticks(5):
        y = value(tick)
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
        parts.append(f'<text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:g}{unit}</text>')
    return parts


def _points(points: Iterable[Point]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _svg(height: float, parts: Iterable[str]) -> str:
    return f'<svg viewBox="0 0 {WIDTH} {height:.0f}" role="img">{"".join(parts)}</svg>'
