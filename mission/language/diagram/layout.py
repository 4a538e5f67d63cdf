"""Where everything stands: nested boxes in one column, transitions as wires in lanes to their right.

All ways of one kind into a state share one wire, so that the picture stays readable however many there are. Sizes are
in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from mission.language.diagram.parts import Kind, details, kinds, label
from mission.language.document import Mission, Transition

ROW = 15.0
PAD = 6.0
INDENT = 12.0
COLUMN = 450.0
LANE = 11.0
MARGIN = 18.0
TITLE = 34.0


@dataclass
class Box:
    """One state. Coordinates of its corner, size, and where its name's line is."""

    path: str
    x: float
    y: float
    width: float
    height: float = 0.0
    composite: bool = False
    name: str = ""
    details: str = ""

    @property
    def right(self) -> float:
        """The right edge."""
        return self.x + self.width

    @property
    def line(self) -> float:
        """Height of the name's middle, where wires arrive."""
        return self.y + PAD + ROW / 2


@dataclass(frozen=True)
class Port:
    """An event at a state's right edge, where a wire begins."""

    transition: Transition
    kind: Kind
    x: float
    y: float
    text: str


@dataclass(frozen=True)
class Wire:
    """All ways of one kind into one state: from the ports into a lane and along it to the target."""

    target: str
    kind: Kind
    ports: tuple[Port, ...]
    arrive: tuple[float, float]
    lane_x: float


@dataclass
class Layout:
    """The finished page."""

    width: float
    height: float
    boxes: list[Box] = field(default_factory=list)
    ports: list[Port] = field(default_factory=list)
    wires: list[Wire] = field(default_factory=list)
    initials: set[str] = field(default_factory=set)


_ORDER: dict[Kind, int] = {"way": 0, "outcome": 1, "operator": 2, "safety": 3}


def layout(mission: Mission) -> Layout:
    """Place every state, event and way of a mission."""
    return _Placing(mission).page()


class _Placing:
    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.kinds = kinds(mission)
        self.boxes: dict[str, Box] = {}
        self.ports: list[Port] = []
        self.y = MARGIN + TITLE

    def page(self) -> Layout:
        mission = self.mission
        if mission.on:
            root = Box("", MARGIN, self.y, COLUMN, name="in every state")
            self.header(root, mission.on)
            root.height = self.y - root.y
            self.boxes[""] = root
            self.y += PAD
        for path, state in mission.states.items():
            if state.parent is None:
                self.place(path, MARGIN, COLUMN)
        wires = self.wires()
        right = max([MARGIN + COLUMN, *(wire.lane_x for wire in wires)])
        initials = {mission.initial} | {state.initial for state in mission.states.values() if state.initial}
        return Layout(right + MARGIN, self.y + MARGIN, list(self.boxes.values()), self.ports, wires, initials)

    def place(self, path: str, x: float, width: float) -> None:
        state = self.mission.states[path]
        box = Box(path, x, self.y, width, 0.0, bool(state.children), state.name, details(self.mission, path))
        self.boxes[path] = box
        self.header(box, state.on)
        for child in state.children:
            self.place(child, x + INDENT, width - 2 * INDENT)
        if state.children:
            self.y += PAD - 2
        box.height = self.y - box.y
        self.y += PAD

    def header(self, box: Box, on: tuple[Transition, ...]) -> None:
        """A state's name and its events, each on a line of its own at the right edge."""
        y = box.y + PAD
        for row, transition in enumerate(sorted(on, key=lambda one: _ORDER[self.kinds[one.key]])):
            kind = self.kinds[transition.key]
            self.ports.append(Port(transition, kind, box.right, y + (row + 0.5) * ROW, label(transition)))
        self.y = y + max(1, len(on)) * ROW + PAD

    def wires(self) -> list[Wire]:
        """The ways, shortest in the innermost lanes, none touching another in its lane."""
        grouped: dict[tuple[str, Kind], list[Port]] = {}
        for port in self.ports:
            grouped.setdefault((port.transition.target, port.kind), []).append(port)
        arrivals: dict[str, int] = {}
        planned: list[tuple[float, float, str, Kind, list[Port], tuple[float, float]]] = []
        for (target, kind), ports in sorted(grouped.items(), key=lambda item: _ORDER[item[0][1]]):
            box = self.boxes[target]
            offset = (0.0, 3.5, -3.5, 7.0)[min(arrivals.get(target, 0), 3)]
            arrivals[target] = arrivals.get(target, 0) + 1
            arrive = (box.right, box.y + PAD + offset)
            heights = [port.y for port in ports] + [arrive[1]]
            planned.append((min(heights), max(heights), target, kind, ports, arrive))
        lanes: list[list[tuple[float, float]]] = []
        wires: list[Wire] = []
        for low, high, target, kind, ports, arrive in sorted(planned, key=lambda plan: plan[1] - plan[0]):
            number = next(
                (n for n, lane in enumerate(lanes) if all(high + 3 < a or low - 3 > b for a, b in lane)), len(lanes)
            )
            if number == len(lanes):
                lanes.append([])
            lanes[number].append((low, high))
            lane_x = MARGIN + COLUMN + 12 + number * LANE
            wires.append(Wire(target, kind, tuple(ports), arrive, lane_x))
        return wires
