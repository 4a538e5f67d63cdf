"""Every code that a check can print: one table, so that nothing is reported that is not declared and documented.

Codes are stable: a code keeps its meaning for good, and one that is no longer used is not given away again.
M0xx reading, M1xx files and references, M2xx names and values, M3xx the machine as a whole, M4xx proof,
M5xx scenarios.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType


class Level(StrEnum):
    """An error keeps a mission from being flown; a warning does not."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True)
class Code:
    """One kind of finding. `allowed`: whether `# allow: CODE` on the line may silence it."""

    name: str
    text: str
    level: Level = Level.ERROR
    allowed: bool = False


_W = Level.WARNING

_TABLE = (
    Code("M001", "the file cannot be read, or is too large"),
    Code("M002", "the text is not YAML"),
    Code("M003", "a tab indents a line"),
    Code("M004", "a key appears twice"),
    Code("M005", "a tag asks for something that a mission must not create"),
    Code("M006", "anchors or nesting grow out of all proportion"),
    Code("M007", "a control character stands in the text"),
    Code("M008", "an alias names an anchor that does not exist"),
    Code("M101", "a file that the mission names does not exist"),
    Code("M102", "files include each other in a circle"),
    Code("M103", "a path leaves the mission's folders"),
    Code("M104", "a reference names a parameter that does not exist"),
    Code("M105", "a reference is malformed or leads in a circle"),
    Code("M106", "an override cannot be applied"),
    Code("M107", "a parameter is never used", _W, allowed=True),
    Code("M108", "`# allow:` names no code, or one that nothing on the line raises", _W),
    Code("M201", "a key is missing"),
    Code("M202", "a key is unknown"),
    Code("M203", "a value has the wrong type"),
    Code("M204", "a value is outside its limits"),
    Code("M205", "values contradict each other"),
    Code("M206", "the format version is not one that this program reads"),
    Code("M207", "a name is not usable as a name"),
    Code("M210", "a behaviour does not exist"),
    Code("M211", "an event does not exist"),
    Code("M212", "a target state does not exist"),
    Code("M213", "a condition cannot be understood"),
    Code("M214", "a state is two kinds of state at once, or none"),
    Code("M215", "history of a state that has nothing inside"),
    Code("M216", "an event that no behaviour here can raise", allowed=True),
    Code("M301", "a state cannot be reached", allowed=True),
    Code("M302", "no final state can be reached from a state"),
    Code("M303", "an outcome of a behaviour is handled by nobody", allowed=True),
    Code("M304", "a transition can never be taken", allowed=True),
    Code("M305", "a cycle has no bound", allowed=True),
    Code("M306", "an airborne state has no deadline", allowed=True),
    Code("M307", "a safety event is unhandled in an airborne state"),
    Code("M308", "the way out after a safety event relies on vision", allowed=True),
    Code("M309", "the mission can end in the air"),
    Code("M310", "a behaviour is started on the wrong side of take-off", allowed=True),
    Code("M311", "a standoff contradicts the clearance of its state", _W, allowed=True),
    Code("M312", "a state does nothing and nothing leads out of it by itself", _W, allowed=True),
    Code("M401", "a safety property does not hold"),
    Code("M402", "an invariant that the mission states does not hold"),
    Code("M501", "a scenario file is wrong"),
    Code("M502", "a scenario does not go as expected"),
    Code("M503", "scenarios leave states or transitions out"),
)

CODES: Mapping[str, Code] = MappingProxyType({code.name: code for code in _TABLE})
