"""The journal: what happened and what was decided, one line of JSON each, on the disk before it takes effect."""

from __future__ import annotations

import asyncio
import json
import math
import os
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from devices.torn_files import LARGEST

FORMAT = 1  # of the journal, as its first line says
_encode = json.JSONEncoder(allow_nan=False, ensure_ascii=False, check_circular=False).encode  # what `_plain` returns
_AS_IT_IS = frozenset((str, int, bool, type(None)))
_NAMES = {"event": ("event",), "transition": ("key", "to")}
SLOWEST_DISK_S = 1.0  # a disk that takes longer must not hold up the flight


class JournalError(RuntimeError):
    """A journal that cannot be written or read; the message is one line for a person."""


@dataclass(frozen=True)
class Entry:
    """One line: its number from 0, mission seconds, kind (start, event, transition, operator, memory, end, …)."""

    seq: int
    t: float
    kind: str
    fields: Mapping[str, Any]


class Journal:
    """Appends lines, flushed and synchronised to the disk.

    `threaded` writes beside the event loop, so that a slow disk never delays a setpoint; without it (lockstep time)
    each line is written at once. A disk that fails in flight is reported once through `on_lost` and never raised: from
    then on lines are only counted, in `lost`. Times are rounded to 1 ms; nothing in a line depends on the machine.
    """

    def __init__(self, path: Path | None, *, threaded: bool = False, seq: int = 0, sync: bool = True) -> None:
        """Create the file, or go on with it.

        Raises:
            JournalError: the file cannot be created.
        """
        self.path = path
        self.lost = 0
        self.error: str | None = None
        self.on_lost: Callable[[str], None] | None = None
        self._seq = seq
        self._sync = sync
        self._file = None if path is None else _opened(path, sync)
        self._writer = ThreadPoolExecutor(1, "journal") if threaded and path is not None else None
        self._last: Future[None] | None = None
        self._held = ""

    @property
    def pending(self) -> bool:
        """Whether there is anything to wait for."""
        return bool(self._held) or (self._last is not None and not self._last.done())

    def append(self, kind: str, t: float, *, soon: bool = False, **fields: Any) -> Entry:
        """Write one line; `durable` waits for it. `soon`: it goes to the disk together with the next line."""
        entry = Entry(self._seq, round(t, 3), kind, {name: _plain(value) for name, value in fields.items()})
        self._seq += 1
        self._held += _encode({"seq": entry.seq, "t": entry.t, "kind": kind, **entry.fields}) + "\n"
        if self._writer is None or not soon:
            self._hand_over(soon)
        return entry

    def durable(self) -> asyncio.Future[None]:
        """Done when every line so far is on the disk, or lost. Whoever waits for it waits for `SLOWEST_DISK_S` at
        most."""
        self._hand_over()
        loop = asyncio.get_running_loop()
        if self._last is not None and self.pending:
            return asyncio.wrap_future(self._last, loop=loop)
        done = loop.create_future()
        done.set_result(None)
        return done

    def close(self) -> None:
        """Write what is left and close; idempotent."""
        self._hand_over()
        if self._writer is not None:
            self._writer.shutdown(wait=True)
            self._writer = None
        if self._file is not None:
            try:
                self._file.close()
            except OSError as error:
                self._fail(error)
            self._file = None

    def _hand_over(self, soon: bool = False) -> None:
        lines, self._held = self._held, ""
        if not lines:
            return
        if self._writer is not None:
            self._last = self._writer.submit(self._write, lines, soon)
        else:
            self._write(lines, soon)

    def _write(self, lines: str, soon: bool) -> None:
        if self._file is None:
            return
        if self.error is not None:
            self.lost += lines.count("\n")
            return
        try:
            self._file.write(lines.encode())
            self._file.flush()
            if self._sync and not soon:
                os.fsync(self._file.fileno())
        except (OSError, ValueError) as error:
            self._fail(error, lines.count("\n"))

    def _fail(self, error: Exception, lines: int = 1) -> None:
        self.lost += lines
        if self.error is None:
            reason = error.strerror if isinstance(error, OSError) else str(error)
            self.error = f"{self.path}: the journal cannot be written any more ({reason}); free space or check the disk"
            if self.on_lost is not None:
                self.on_lost(self.error)


def read_journal(path: Path) -> tuple[Entry, ...]:
    """Every whole line of a journal. A last line that was torn by a crash is left out.

    Raises:
        JournalError: the file is missing, is not a journal, or is damaged before its last line.
    """
    try:
        if path.exists() and (not path.is_file() or path.stat().st_size > LARGEST):
            raise JournalError(f"{path}: not a journal: a plain file of at most {LARGEST // 1_000_000} MB is expected")
        lines = path.read_bytes().split(b"\n")
    except OSError as error:
        raise JournalError(f"{path}: {error.strerror}; name the folder of a run that has a journal.jsonl") from None
    entries: list[Entry] = []
    for number, line in enumerate(lines, 1):
        if not line:
            continue
        entry = _parsed(line)
        if entry is None or entry.seq != len(entries):
            if entry is None and number == len(lines):
                break
            raise JournalError(f"{path}:{number}: not line {len(entries)} of a journal; the file was damaged or edited")
        entries.append(entry)
    return tuple(entries)


def reopen(path: Path, *, threaded: bool = False) -> tuple[Journal, tuple[Entry, ...]]:
    """The journal of an interrupted run to go on with, cut back to its last whole line, and what it says.

    Raises:
        JournalError: as `read_journal`, or the file cannot be written.
    """
    entries = read_journal(path)
    content = path.read_bytes()
    whole = content.rfind(b"\n") + 1
    if _parsed(content[whole:]) is not None:
        content, whole = content + b"\n", len(content) + 1
    try:
        with path.open("r+b") as file:
            file.seek(0)
            file.write(content[:whole])
            file.truncate(whole)
            os.fsync(file.fileno())
    except OSError as error:
        raise JournalError(f"{path}: {error.strerror}; the run cannot be continued") from None
    return Journal(path, threaded=threaded, seq=len(entries)), entries


def _opened(path: Path, sync: bool) -> Any:
    try:
        file = path.open("ab")
        if not sync:
            return file
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as error:
        raise JournalError(f"{path}: {error.strerror}; the journal needs a folder that can be written") from None
    return file


def _parsed(line: bytes) -> Entry | None:
    try:
        fields = json.loads(line)
        entry = Entry(int(fields.pop("seq")), float(fields.pop("t")), str(fields.pop("kind")), fields)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    told = all(isinstance(fields.get(name), str) for name in _NAMES.get(entry.kind, ()))
    return entry if told and math.isfinite(entry.t) else None


def _plain(value: Any) -> Any:
    """Values as JSON knows them: no NaN, no numpy, floats to a micro-unit so that a line stays short."""
    if type(value) in _AS_IT_IS:
        return value
    if isinstance(value, float):
        return round(float(value), 6) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(name): _plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return value if isinstance(value, int | str) else str(value)
