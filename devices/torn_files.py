"""Reading files that a killed program may have left torn: whole lines only; a missing file reads as an empty one."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

LARGEST = 256_000_000
"""Bytes of one file; an hour's flight leaves a tenth of it."""


def json_lines(path: Path) -> Iterator[Mapping[str, Any]]:
    """Objects of a JSON-lines file; a line that is torn or no object is left out."""
    if not _is_record(path):
        return
    try:
        text = path.read_text("utf-8", errors="replace")
    except OSError:
        return
    for line in text.splitlines():
        try:
            fields = json.loads(line, parse_constant=_refuse)
        except (ValueError, RecursionError):
            continue
        if isinstance(fields, dict):
            yield fields


def csv_rows(path: Path) -> list[Mapping[str, str]]:
    """Rows of a CSV file; a torn last row is left out."""
    if not _is_record(path):
        return []
    try:
        with path.open(encoding="utf-8", errors="replace", newline="") as file:
            return [row for row in csv.DictReader(file) if None not in row.values() and None not in row]
    except (OSError, csv.Error):
        return []


def _is_record(path: Path) -> bool:
    """Whether a path is a plain file of a size that a flight may leave."""
    try:
        return path.is_file() and path.stat().st_size <= LARGEST
    except OSError:
        return False


def _refuse(constant: str) -> Any:
    raise ValueError(f"{constant} is no JSON")
