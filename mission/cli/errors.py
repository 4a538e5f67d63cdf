"""What a person reads when something goes wrong: one line that names it, and the exit code that scripts rely on."""

from __future__ import annotations

import os
import sys
from pathlib import Path

COMPLETED = 0
ABORTED = 1
USAGE = 2
REFUSED = 3
INTERRUPTED = 130

OUTCOME_CODES = {"completed": COMPLETED, "refused": REFUSED}

EXPECTED = (
    ("mission.language.document", "MissionFileError", USAGE),
    ("mission.record.folder", "RunFolderError", USAGE),
    ("mission.executive.journal", "JournalError", USAGE),
    ("mission.executive.resume", "ResumeError", USAGE),
    ("mission.executive.stage", "FlightError", REFUSED),
    ("flight.autopilot", "AutopilotError", REFUSED),
    ("devices.rig", "CaptureError", REFUSED),
)
"""Errors that a person can do something about, and their exit codes. Their modules are not imported for this: an error
whose class was never loaded cannot have been raised."""

OPTIONAL = {"pymavlink": "sim", "matplotlib": "dev"}
"""Packages that come with an extra of this project."""


class CommandError(Exception):
    """A command cannot go on; the message is one line for a person, `code` the exit code."""

    def __init__(self, message: str, code: int = USAGE) -> None:
        super().__init__(message)
        self.code = code


def explain(error: BaseException) -> int:
    """Print what a person should know of an error and return the exit code."""
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else (USAGE if error.code else COMPLETED)
    if isinstance(error, BrokenPipeError):
        # Whoever read the output has seen enough; Python must not complain about it again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return COMPLETED
    lines, code = _described(error)
    for line in lines:
        print(line, file=sys.stderr)
    return code


def _described(error: BaseException) -> tuple[list[str], int]:
    if isinstance(error, KeyboardInterrupt) or type(error).__name__ == "Abort":
        return ["mission: interrupted"], INTERRUPTED
    if isinstance(error, CommandError):
        return [f"mission: {one_line(error)}"], error.code
    if hasattr(error, "format_message") and hasattr(error, "exit_code"):
        return [_usage(error)], USAGE
    for module, name, code in EXPECTED:
        kind = getattr(sys.modules.get(module), name, None)
        if kind is not None and isinstance(error, kind):
            # A mission file's error is one line per mistake, each of which names its place.
            return [clean(line) for line in str(error).splitlines() if line.strip()], code
    if isinstance(error, OSError) and error.strerror:
        what = f"{error.filename}: " if error.filename else ""
        return [f"mission: {clean(what)}{error.strerror.lower()}"], USAGE
    if isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] in OPTIONAL:
        package = (error.name or "").partition(".")[0]
        extra = OPTIONAL[package]
        return [f"mission: this needs the package {package}: pip install 'blade-mission[{extra}]'"], USAGE
    return [f"mission: {_unexpected(error)}"], ABORTED


def _usage(error: BaseException) -> str:
    context = getattr(error, "ctx", None)
    where = context.command_path if context is not None else "mission"
    message = one_line(error.format_message()).rstrip(".")  # type: ignore[attr-defined]
    return f"{where}: {message[:1].lower()}{message[1:]} (see `{where} --help`)"


def _unexpected(error: BaseException) -> str:
    path = write_details(error)
    told = f"details in {path}" if path else "and the details could not be written anywhere"
    return f"unexpected error, please report it: {type(error).__name__}: {one_line(error)}; {told}"


def write_details(error: BaseException) -> Path | None:
    """Write the traceback to a file of its own and return where, None where nothing can be written."""
    import tempfile
    import traceback

    try:
        with tempfile.NamedTemporaryFile("w", prefix="mission-error-", suffix=".txt", delete=False) as file:
            file.write(f"{' '.join(sys.argv)}\n\n{''.join(traceback.format_exception(error))}")
            return Path(file.name)
    except OSError:
        return None


def one_line(message: object) -> str:
    """A message as a single printable line."""
    return clean(" ".join(str(message).split()))


def clean(text: str) -> str:
    """Text without control characters: a name in a file must not be able to write to a terminal."""
    return "".join(character if character.isprintable() else "�" for character in text)
