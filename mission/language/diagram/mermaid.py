"""A mission as Mermaid text, which code hosts and wikis draw."""

from __future__ import annotations

from collections.abc import Iterator

from mission.language.diagram.parts import Kind, details, kinds, label
from mission.language.diagram.svg import COLOURS
from mission.language.document import Mission

_ARROWS: dict[Kind, str] = {"way": "==>", "outcome": "-->", "safety": "-->", "operator": "-.->"}


def mermaid(mission: Mission) -> str:
    """A flowchart: composites as subgraphs, what is entered first marked, the way to completion
    thick, safety red, the operator's ways dotted."""
    lines = ["flowchart TD", '  start((" "))']
    for path, state in mission.states.items():
        if state.parent is None:
            lines += _state(mission, path, "  ")
    if mission.on:
        lines.append('  everywhere[/"in every state"/]')
    lines.append(f"  start ==> {_id(mission.initial)}")
    styles: list[str] = []
    sorts = kinds(mission)
    for number, transition in enumerate(mission.transitions(), 1):
        kind = sorts[transition.key]
        source = _id(transition.source) if transition.source else "everywhere"
        lines.append(f'  {source} {_ARROWS[kind]}|"{_text(label(transition))}"| {_id(transition.target)}')
        if kind != "outcome":
            styles.append(f"  linkStyle {number} stroke:{COLOURS[kind]},color:{COLOURS[kind]}")
    return "\n".join([*lines, *styles, ""])


def _state(mission: Mission, path: str, indent: str) -> Iterator[str]:
    state = mission.states[path]
    first = state.parent is not None and mission.states[state.parent].initial == path
    name = f"▸ {state.name}" if first else state.name
    if state.children:
        yield f'{indent}subgraph {_id(path)}["{_text(name)}"]'
        for child in state.children:
            yield from _state(mission, child, indent + "  ")
        yield f"{indent}end"
        return
    text = "<br/>".join(_text(part) for part in (name, details(mission, path)) if part)
    yield f'{indent}{_id(path)}(["{text}"])' if state.final else f'{indent}{_id(path)}["{text}"]'


def _id(path: str) -> str:
    return "s_" + path.replace("_", "__").replace(".", "_")


def _text(text: str) -> str:
    """Text inside quotes: Mermaid writes its own character references with #."""
    return text.replace("#", "#35;").replace('"', "#quot;").replace("<", "#lt;").replace(">", "#gt;")
