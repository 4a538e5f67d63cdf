"""The journal as it grows, each line in a person's words."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from mission.executive.events import EVENTS, Severity


class JournalFollower:
    """Reads what was added since the last look; a half-written line waits for its end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0

    def news(self) -> Iterator[tuple[float, str]]:
        """Mission seconds and text of every new line that is worth a person's while."""
        try:
            with self._path.open("rb") as file:
                file.seek(self._offset)
                added = file.read()
        except OSError:
            return
        whole = added.rfind(b"\n") + 1
        self._offset += whole
        for line in added[:whole].splitlines():
            try:
                fields = json.loads(line)
            except ValueError:
                continue
            text = told(fields)
            if text:
                yield float(fields.get("t", 0.0)), text


def told(line: Mapping[str, Any]) -> str:
    """One line of the journal for a person; empty where it says nothing new."""
    match line.get("kind"):
        case "start":
            return f"{'goes on' if line.get('resumed') else 'begins'} in {line.get('state')}"
        case "transition":
            return f"{line.get('event')} → {line.get('to')}"
        case "event" if line.get("led_to") != "transition" and not _small(line):
            return f"{line.get('event')}: {line.get('led_to')}"
        case "operator":
            return f"{line.get('who')}: {line.get('command')}"
        case "fault":
            return f"fault: {line.get('error')}"
        case "end":
            return f"{line.get('outcome')} in {line.get('state')}"
    return ""


def _small(line: Mapping[str, Any]) -> bool:
    """News that changed nothing and that nobody has to act on."""
    event = EVENTS.get(str(line.get("event")))
    return line.get("led_to") in ("ignored", "stale") and event is not None and event.severity is Severity.INFO
