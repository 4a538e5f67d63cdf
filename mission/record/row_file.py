"""A file that grows by whole lines in flight: a full disk loses lines, which is told once, and never raises."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any


class RowFile:
    """Lines appended to a new file and handed to the system one by one, so that a killed run keeps what it had written.

    `lost` counts the lines that could not be written; `on_lost` is told of the first.
    """

    def __init__(self, path: Path, header: str = "", on_lost: Callable[[str], None] | None = None) -> None:
        """Create the file.

        Raises:
            OSError: it cannot be created.
        """
        self.path = path
        self.lost = 0
        self._on_lost = on_lost
        self._file = path.open("w", encoding="utf-8", buffering=1)
        if header:
            self.line(header)

    def line(self, text: str) -> None:
        """Append one line."""
        try:
            self._file.write(text + "\n")
        except (OSError, ValueError) as error:
            self.lost += 1
            if self.lost == 1 and self._on_lost is not None:
                self._on_lost(f"{self.path}: {error}")

    def row(self, values: Iterable[object]) -> None:
        """Append comma-separated values: empty for None and NaN, floats to a tenth of a millimetre."""
        self.line(",".join(_cell(value) for value in values))

    def json(self, fields: Mapping[str, Any]) -> None:
        """Append a JSON object; NaN becomes null."""
        self.line(json.dumps(plain(fields), allow_nan=False, ensure_ascii=False))

    def close(self) -> None:
        """Close the file; idempotent."""
        try:
            self._file.close()
        except OSError:
            self.lost += 1


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, int | str):
        return str(value)
    number = float(value)  # type: ignore[arg-type]
    return f"{number:.4f}" if math.isfinite(number) else ""


def plain(value: Any, digits: int = 4) -> Any:
    """Numbers, arrays and mappings as JSON knows them."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Mapping):
        return {str(name): plain(item, digits) for name, item in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist(), digits)
    if isinstance(value, list | tuple):
        return [plain(item, digits) for item in value]
    return round(float(value), digits) if math.isfinite(value) else None
