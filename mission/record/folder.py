"""A run's folder: `logs/<UTC time>-<mission>/`, made whole or not at all."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

NEEDED_WITHOUT_FRAMES_MB = 20
NEEDED_MB = 300
"""A run of the default mission leaves about 60 MB; a long one must not die of a full disk near the blade."""


class RunFolderError(RuntimeError):
    """The folder cannot be made or is not a run's; one line for a person."""


@dataclass(frozen=True)
class RunFolder:
    """Where everything of one run lies."""

    path: Path

    @property
    def name(self) -> str:
        """The run's name, `20261121T101500Z-v80_blade`."""
        return self.path.resolve().name

    @property
    def mission(self) -> Path:
        """The resolved mission document."""
        return self.path / "mission.yaml"

    @property
    def journal(self) -> Path:
        """Every event and transition, JSON lines."""
        return self.path / "journal.jsonl"

    @property
    def log(self) -> Path:
        """The run log, JSON lines."""
        return self.path / "run.log.jsonl"

    @property
    def frames(self) -> Path:
        """Folder of the recorded images and their `frames.jsonl`."""
        return self.path / "frames"

    @property
    def telemetry(self) -> Path:
        """Folder of telemetry.csv, setpoints.csv, vision.jsonl and, in simulation, truth.csv."""
        return self.path / "telemetry"

    @property
    def truth(self) -> Path:
        """What the simulated vehicle truly did; only in simulation."""
        return self.telemetry / "truth.csv"

    @property
    def summary(self) -> Path:
        """The run in numbers."""
        return self.path / "summary.json"

    @property
    def report(self) -> Path:
        """The run as a page."""
        return self.path / "report.html"


def create(logs: Path, mission: str, resolved_yaml: str, needed_mb: int = NEEDED_MB) -> RunFolder:
    """Make the folder of a new run below `logs`, with the resolved mission in it.

    Raises:
        RunFolderError: it cannot be written, or the disk is nearly full; nothing is left behind.
    """
    logs = logs.expanduser()
    existed = logs.exists()
    path: Path | None = None
    try:
        logs.mkdir(parents=True, exist_ok=True)
        if not os.access(logs, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(logs))
        free_mb = shutil.disk_usage(logs).free // 2**20
        if free_mb < needed_mb:
            raise RunFolderError(
                f"{logs}: {free_mb} MB free, a run needs {needed_mb} MB: free some space or choose --record DIR"
            )
        path = _unique(logs, mission)
        folder = RunFolder(path)
        folder.frames.mkdir()
        folder.telemetry.mkdir()
        draft = folder.mission.with_suffix(".part")
        with draft.open("w", encoding="utf-8") as file:
            file.write(resolved_yaml)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(folder.mission)  # a folder without it is no run
        log_line(folder, "run_created")
    except (OSError, RunFolderError) as error:
        if path is not None:
            shutil.rmtree(path, ignore_errors=True)
        if not existed:
            _remove_empty(logs)
        if isinstance(error, RunFolderError):
            raise
        raise RunFolderError(
            f"{error.filename or logs}: cannot write the record, {_reason(error)}: choose another with --record DIR"
        ) from error
    return folder


def log_line(folder: RunFolder, event: str, **fields: object) -> None:
    """Append a line to the run log while nobody else writes there: before the flight, and after it."""
    stamp = datetime.now(UTC).isoformat().replace("+00:00", "Z")
    with folder.log.open("a", encoding="utf-8") as file:
        file.write(json.dumps({**fields, "event": event, "level": "info", "timestamp": stamp}) + "\n")


def open_run(run: Path, logs: Path = Path("logs")) -> RunFolder:
    """The folder of a run that was flown, by its path, its name below `logs`, or `latest`.

    Raises:
        RunFolderError: there is no such run.
    """
    if str(run) == "latest":
        found = sorted(path for path in logs.glob("*Z-*") if (path / "mission.yaml").is_file())
        if not found:
            raise RunFolderError(f"{logs}: no run in this folder yet")
        return RunFolder(found[-1])
    for path in (run, logs / run):
        if (path / "mission.yaml").is_file():
            return RunFolder(path)
    if run.is_dir():
        raise RunFolderError(f"{run}: not the folder of a run (it has no mission.yaml)")
    raise RunFolderError(f"{run}: no such run")


def _unique(logs: Path, mission: str) -> Path:
    """Make a new folder: two runs may start within one second, and neither may write into the other's."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    name = re.sub(r"[^\w.-]+", "_", mission) or "mission"
    for number in range(1, 1000):
        path = logs / (f"{stamp}-{name}" if number == 1 else f"{stamp}-{name}-{number}")
        try:
            path.mkdir()
        except FileExistsError:
            continue
        return path
    raise RunFolderError(f"{logs}: a thousand runs within one second")


def _remove_empty(folder: Path) -> None:
    try:
        folder.rmdir()
    except OSError:
        return


def _reason(error: OSError) -> str:
    if error.errno == errno.ENOSPC:
        return "the disk is full"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        return "it is read-only"
    return (error.strerror or str(error)).lower()
