"""A mission as SVG: one page, light and dark readable in print, no scripts, no fonts from elsewhere."""

from __future__ import annotations

from html import escape

from mission.language.diagram.layout import MARGIN, PAD, ROW, Box, Layout, Port, Wire, layout
from mission.language.diagram.parts import Kind, Painting
from mission.language.document import Mission

COLOURS: dict[Kind, str] = {"way": "#0b4f9e", "outcome": "#5d6d7e", "safety": "#c0392b", "operator": "#8e44ad"}
_WIDTHS: dict[Kind, float] = {"way": 2.4, "outcome": 1.1, "safety": 1.1, "operator": 1.1}
_MEANING: dict[Kind, str] = {
    "way": "the way to completion",
    "outcome": "other outcomes",
    "safety": "safety",
    "operator": "operator",
}
_FINAL = {"completed": "#1e8449", "aborted": "#b9770e", "refused": "#b9770e", "released": "#6c3483"}


def svg(mission: Mission, painting: Painting | None = None) -> str:
    """The picture as text. With a painting, the states that a run was in are filled, with visits and seconds."""
    page = layout(mission)
    width, height = max(page.width, 480.0), page.height
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="11">',
        f"<title>{escape(mission.name)}</title>",
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
        _defs(),
        _title(mission, painting),
    ]
    lines += [_box(mission, box, page, painting) for box in page.boxes]
    lines += [_wire(wire, painting) for wire in sorted(page.wires, key=lambda wire: wire.kind == "way")]
    lines += [_port(port, painting) for port in page.ports]
    return "\n".join([*lines, "</svg>", ""])


def _defs() -> str:
    heads = [
        f'<marker id="{kind}" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        f'markerUnits="userSpaceOnUse" orient="auto"><path d="M0,0.5 L8,4 L0,7.5 z" fill="{colour}"/></marker>'
        for kind, colour in COLOURS.items()
    ]
    return f"<defs>{''.join(heads)}</defs>"


def _title(mission: Mission, painting: Painting | None) -> str:
    text = f"{mission.name}" + (f" · run {painting.run}" if painting is not None else "")
    parts = [f'<text x="{MARGIN}" y="{MARGIN + 4}" font-size="15" font-weight="bold">{escape(text)}</text>']
    x = MARGIN
    for kind, colour in COLOURS.items():
        y = MARGIN + 20
        parts.append(
            f'<line x1="{x:.0f}" y1="{y}" x2="{x + 18:.0f}" y2="{y}" stroke="{colour}" '
            f'stroke-width="{_WIDTHS[kind]}"{_dash(kind)}/>'
            f'<text x="{x + 22:.0f}" y="{y + 4}" font-size="10" fill="#444">{_MEANING[kind]}</text>'
        )
        x += 34 + 5.4 * len(_MEANING[kind])
    return "".join(parts)


def _box(mission: Mission, box: Box, page: Layout, painting: Painting | None) -> str:
    state = mission.states.get(box.path)
    visit = painting.visits.get(box.path) if painting is not None else None
    fill = "#f4f6f8" if box.composite else "#ffffff"
    stroke = "#2c3e50"
    if state is not None and state.final is not None:
        stroke = _FINAL[state.final]
        fill = "#ffffff"
    if visit is not None and not box.composite:
        fill = "#fff3c4"
    radius = 12 if state is not None and state.final is not None else 5
    dashed = ' stroke-dasharray="4 3"' if not box.path else ""
    heavy = 2 if state is not None and state.final is not None else 1.3 if visit is not None else 1
    parts = [
        f'<rect x="{box.x}" y="{box.y}" width="{box.width}" height="{box.height}" rx="{radius}" fill="{fill}" '
        f'stroke="{stroke}" stroke-width="{heavy}"{dashed}/>'
    ]
    x, y = box.x + 9, box.y + PAD + ROW - 4
    if box.path in page.initials:
        parts.append(
            f'<circle cx="{x + 2}" cy="{y - 4}" r="3.2" fill="#2c3e50"/>'
            f'<path d="M{x + 5},{y - 4} h8" stroke="#2c3e50" fill="none"/>'
            f'<path d="M{x + 11},{y - 7} l5,3 l-5,3 z" fill="#2c3e50"/>'
        )
        x += 20
    weight = "normal" if not box.path else "bold"
    parts.append(f'<text x="{x}" y="{y}" font-weight="{weight}" font-size="12">{escape(box.name)}</text>')
    after = max(x + 7.2 * len(box.name) + 8, box.x + 130)
    if visit is not None:
        times = f"{visit.times}× " if visit.times > 1 else ""
        parts.append(
            f'<text x="{after}" y="{y}" font-size="10" fill="#9a5b00" font-weight="bold">'
            f"{times}{visit.seconds:.1f} s</text>"
        )
    elif box.details:
        parts.append(f'<text x="{after:.1f}" y="{y}" font-size="10" fill="#555">{escape(box.details)}</text>')
    return "".join(parts)


def _port(port: Port, painting: Painting | None) -> str:
    times = painting.taken.get(port.transition.key, 0) if painting is not None else 0
    weight = ' font-weight="bold"' if port.kind == "way" or times else ""
    counted = f" ({times})" if times > 1 else ""
    return (
        f'<text x="{port.x - 6}" y="{port.y + 3.6}" text-anchor="end" font-size="10.5" '
        f'fill="{COLOURS[port.kind]}"{weight}>{escape(port.text + counted)}</text>'
    )


def _wire(wire: Wire, painting: Painting | None) -> str:
    colour = COLOURS[wire.kind]
    lane, (x, y) = wire.lane_x, wire.arrive
    taken = painting is not None and any(port.transition.key in painting.taken for port in wire.ports)
    width = 3.0 if taken else _WIDTHS[wire.kind]
    faint = ' opacity="0.35"' if painting is not None and not taken else ""
    ends = [port.y for port in wire.ports] + [y]
    paths = [f"M{lane},{min(ends):.1f} V{max(ends):.1f}"]
    paths += [f"M{port.x:.1f},{port.y:.1f} H{lane:.1f}" for port in wire.ports]
    drawn = f'<path d="{" ".join(paths)}" stroke="{colour}" stroke-width="{width}" fill="none"{_dash(wire.kind)}/>'
    arrow = (
        f'<path d="M{lane:.1f},{y:.1f} H{x + 1:.1f}" stroke="{colour}" stroke-width="{width}" fill="none" '
        f'marker-end="url(#{wire.kind})"/>'
    )
    return f"<g{faint}>{drawn}{arrow}</g>"


def _dash(kind: Kind) -> str:
    return ' stroke-dasharray="5 3"' if kind == "operator" else ""
