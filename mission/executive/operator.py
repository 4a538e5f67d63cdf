"""The operator's socket: another shell of the same user may pause, resume, step, skip, abort and ask how it goes.

One line of JSON each way over a Unix-domain socket in the run's folder, which only the user who flies may open.
"""

from __future__ import annotations

import asyncio
import json
import os
import pwd
import socket
import struct
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mission.executive.executive import Executive

SOCKET = "operator.sock"
_LONGEST_LINE = 4096
_LONGEST_PATH = 100  # the system's limit is 107 bytes
_PATIENCE_S = 5.0


class OperatorError(RuntimeError):
    """The run cannot be reached; the message is one line for a person."""


@dataclass(frozen=True)
class Answer:
    """What the run says to a command. done: whether it will be followed. status: a glance at the run."""

    done: bool
    text: str
    status: Mapping[str, Any] = field(default_factory=dict)


def obey(executive: Executive, request: Mapping[str, Any], who: str, at: str) -> Answer:
    """Follow one request, `{"command": …, "target": …}`, of somebody at some wall time."""
    command = request.get("command")
    follow = _COMMANDS.get(command) if isinstance(command, str) else None
    if follow is None:
        return Answer(False, f"{command!r} is not a command; there are {', '.join(_COMMANDS)}")
    done, text = follow(executive, request, {"by": who, "at": at})
    return Answer(done, text, asdict(executive.status()))


@asynccontextmanager
async def serving(executive: Executive, folder: Path) -> AsyncIterator[None]:
    """While inside, the run listens in its folder. A folder that cannot hold a socket is logged and flown without."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            answer = await _answer(executive, reader, writer.get_extra_info("socket"))
            writer.write(json.dumps(asdict(answer), default=str).encode() + b"\n")
            await asyncio.wait_for(writer.drain(), _PATIENCE_S)
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass
        finally:
            writer.close()

    try:
        server = await asyncio.start_unix_server(talk, sock=_bound(folder), limit=_LONGEST_LINE)
    except OSError as error:
        executive.services.log.warning("no operator's socket", folder=str(folder), reason=error.strerror)
        yield
        return
    try:
        yield
    finally:
        server.close()
        with suppress(OSError):
            (folder / SOCKET).unlink()


def tell(folder: Path, command: str, **about: Any) -> Answer:
    """Send one command to the run in a folder and return what it says.

    Raises:
        OperatorError: nobody listens there, it belongs to somebody else, or it does not answer.
    """
    line = json.dumps({"command": command, **about}).encode() + b"\n"
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection, _short(folder) as path:
            connection.settimeout(_PATIENCE_S)
            connection.connect(path)
            connection.sendall(line)
            with connection.makefile("rb") as answers:
                told = json.loads(answers.readline())
                return Answer(bool(told["done"]), str(told["text"]), told["status"])
    except (FileNotFoundError, ConnectionRefusedError):
        raise OperatorError(f"{folder}: no run is being flown there") from None
    except PermissionError:
        raise OperatorError(f"{folder}: the run belongs to another user, who alone may command it") from None
    except (OSError, ValueError, KeyError, TypeError):
        raise OperatorError(f"{folder}: the run does not answer; it may just have ended") from None


def flying(logs: Path) -> tuple[Path, ...]:
    """Folders below `logs` in which a run listens, the newest first."""
    found = sorted((path.parent for path in logs.glob(f"*/{SOCKET}")), reverse=True)
    return tuple(folder for folder in found if _listens(folder))


Follow = Callable[["Executive", Mapping[str, Any], dict[str, Any]], tuple[bool, str]]


def _event(name: str, doing: str, cannot: str) -> Follow:
    def follow(executive: Executive, request: Mapping[str, Any], about: dict[str, Any]) -> tuple[bool, str]:
        if not executive.answers(name):
            return False, f"{cannot} in {executive.status().path}"
        executive.raise_event(name, **about)
        return True, doing

    return follow


def _step(executive: Executive, request: Mapping[str, Any], about: dict[str, Any]) -> tuple[bool, str]:
    if executive.question is None:
        return False, "nothing waits for an answer"
    yes = request.get("yes", True) is True
    executive.note("confirm" if yes else "refuse", about["by"], at=about["at"], question=executive.question.text)
    return True, executive.confirm(yes)


def _skip(executive: Executive, request: Mapping[str, Any], about: dict[str, Any]) -> tuple[bool, str]:
    target = str(request.get("target", ""))
    executive.note("skip", about["by"], at=about["at"], target=target)
    return executive.skip(target)


def _status(executive: Executive, request: Mapping[str, Any], about: dict[str, Any]) -> tuple[bool, str]:
    status = executive.status()
    return True, status.waiting or status.text or status.path


_COMMANDS: Mapping[str, Follow] = {
    "pause": _event("paused", "pausing: the vehicle holds its position", "the mission cannot be paused"),
    "resume": _event("resumed", "going on", "there is nothing to resume"),
    "step": _step,
    "skip": _skip,
    "abort": _event(
        "abort", "aborting: back off, climb clear, go home, land", "the vehicle is already on its way home"
    ),
    "status": _status,
}


async def _answer(executive: Executive, reader: asyncio.StreamReader, connection: Any) -> Answer:
    who = _peer(connection)
    if who is None:
        return Answer(False, "only the user who flies may command this run")
    line = await asyncio.wait_for(reader.readuntil(b"\n"), _PATIENCE_S)
    try:
        request = json.loads(line)
    except ValueError:
        return Answer(False, 'a command is one line of JSON, such as {"command": "status"}')
    if not isinstance(request, dict):
        return Answer(False, 'a command is one line of JSON, such as {"command": "status"}')
    return obey(executive, request, who, datetime.now(UTC).isoformat(timespec="milliseconds"))


def _peer(connection: Any) -> str | None:
    """Who is at the other end; None for anybody but the user who flies."""
    if not hasattr(socket, "SO_PEERCRED"):
        return _name(os.getuid())  # the socket's own permissions must do
    _, uid, _ = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i")))
    return _name(uid) if uid in (os.getuid(), 0) else None


def at_the_keyboard() -> str:
    """Who presses keys in the terminal that flies."""
    return f"{_name(os.getuid())} (keyboard)"


def _name(uid: int) -> str:
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return str(uid)


def _bound(folder: Path) -> socket.socket:
    """A listening socket that never existed with wider permissions."""
    with suppress(FileNotFoundError):
        (folder / SOCKET).unlink()
    bound = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    before = os.umask(0o177)
    try:
        with _short(folder) as path:
            bound.bind(path)
    except OSError:
        bound.close()
        raise
    finally:
        os.umask(before)
    bound.setblocking(False)
    return bound


def _listens(folder: Path) -> bool:
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection, _short(folder) as path:
            connection.settimeout(_PATIENCE_S)
            connection.connect(path)
            return True
    except OSError:
        return False


@contextmanager
def _short(folder: Path) -> Iterator[str]:
    """The socket's path, short enough for the system even where the folder's is not."""
    path = str(folder / SOCKET)
    if len(os.fsencode(path)) <= _LONGEST_PATH:
        yield path
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        yield f"/proc/self/fd/{descriptor}/{SOCKET}"
    finally:
        os.close(descriptor)
