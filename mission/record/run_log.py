"""The run log: what is worth telling and is neither decision nor measurement, as JSON lines; the console is quiet."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import structlog


class _Lines:
    """Writes whole lines; a full disk loses them without a word, since nothing here is worth an aircraft."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("a", encoding="utf-8", buffering=1)

    def msg(self, line: str) -> None:
        try:
            self._file.write(line + "\n")
        except (OSError, ValueError):
            return

    log = debug = info = warning = warn = error = critical = exception = fatal = failure = err = msg

    def close(self) -> None:
        self._file.close()


class _ToRunLog(logging.Handler):
    """Passes on what libraries say through Python's own logging."""

    def emit(self, record: logging.LogRecord) -> None:
        structlog.get_logger(record.name).log(record.levelno, record.getMessage())


class RunLog:
    """The run log of one run at a time: structlog and Python's logging go to the file until `close`."""

    def __init__(self, path: Path) -> None:
        """Create the file and send everything there.

        Raises:
            OSError: it cannot be created.
        """
        self._lines = _Lines(path)
        self._handler = _ToRunLog(logging.WARNING)
        structlog.configure(
            processors=[
                structlog.contextvars.merge_contextvars,
                structlog.processors.add_log_level,
                structlog.processors.TimeStamper(fmt="iso", utc=True),
                structlog.processors.dict_tracebacks,
                structlog.processors.JSONRenderer(default=str, ensure_ascii=False),
            ],
            wrapper_class=structlog.make_filtering_bound_logger(logging.DEBUG),
            logger_factory=lambda *_: self._lines,
            cache_logger_on_first_use=False,
        )
        logging.getLogger().addHandler(self._handler)
        logging.captureWarnings(True)

    @property
    def logger(self) -> Any:
        """A structlog logger that writes here."""
        return structlog.get_logger()

    def close(self) -> None:
        """Write no more; structlog is as it was before."""
        logging.captureWarnings(False)
        logging.getLogger().removeHandler(self._handler)
        structlog.reset_defaults()
        self._lines.close()
