"""An operator steps in: over the socket of a run, with keys, and by the autonomy that was chosen."""

from __future__ import annotations

import asyncio
import json
import socket
import stat
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from mission.cli.main import main
from mission.executive.operator import SOCKET, Answer, OperatorError, flying, serving, tell
from mission.executive.question import asking

MISSION = {
    "inspect": {
        "on": {"paused": "holding", "abort": "home"},
        "states": {
            "out": {"do": "wait", "timeout_s": 1e6},
            "back": {"do": "wait", "timeout_s": 1e6, "entry": True},
        },
    },
    "holding": {"timeout_s": 1e6, "on": {"resumed": {"to": "inspect", "history": "deep"}, "abort": "home"}},
    "home": {"do": "finish", "on": {"done": "aborted"}},
    "aborted": {"final": "aborted"},
}


@pytest.fixture
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs") / "run"
    folder.mkdir()
    return folder


def flown(fly: Any, folder: Path, talk: Callable[[Any], Awaitable[None]], **about: Any) -> Any:
    flight = fly(MISSION, **about)

    async def beside(executive: Any) -> None:
        async with serving(executive, folder):
            await talk(executive)
            executive.interrupt()

    flight.run_on_the_wall(beside)
    return flight


async def told(folder: Path, command: str, **about: Any) -> Answer:
    return await asyncio.to_thread(tell, folder, command, **about)


async def until(executive: Any, path: str) -> None:
    """Wait until the machine has come to a state."""
    while executive.status().path != path:  # noqa: ASYNC110 (it is the product's own public face)
        await asyncio.sleep(0.005)


def test_pause_holds_and_resume_goes_on_where_it_was(fly: Any, short: Path) -> None:
    async def talk(executive: Any) -> None:
        assert (await told(short, "status")).status["path"] == "inspect.out"
        assert (await told(short, "pause")).done
        await until(executive, "holding")
        paused = await told(short, "status")
        assert paused.status["paused"] and paused.status["path"] == "holding"
        again = await told(short, "pause")
        assert not again.done and "holding" in again.text
        assert (await told(short, "resume")).done
        await until(executive, "inspect.out")

    flight = flown(fly, short, talk)
    acts = [fields for kind, fields in flight.journal if kind == "operator"]
    assert [act["command"] for act in acts] == ["paused", "resumed"]
    assert all(act["who"] and act["at"].startswith("20") for act in acts)


def test_skip_goes_to_an_entry_and_nowhere_else(fly: Any, short: Path) -> None:
    async def talk(executive: Any) -> None:
        refused = await told(short, "skip", target="holding")
        assert not refused.done and "inspect.back" in refused.text
        assert (await told(short, "skip", target="inspect.back")).done
        await until(executive, "inspect.back")

    assert "inspect.back" in flown(fly, short, talk).walked


def test_abort_over_the_socket_flies_home(fly: Any, short: Path) -> None:
    async def talk(executive: Any) -> None:
        assert (await told(short, "abort")).done
        await until(executive, "home")
        late = await told(short, "abort")
        assert not late.done and "already" in late.text

    assert flown(fly, short, talk).walked == ["home", "aborted"]


def test_only_the_same_user_may_open_the_socket_and_it_is_gone_afterwards(fly: Any, short: Path) -> None:
    seen: list[int] = []

    async def talk(executive: Any) -> None:
        seen.append(stat.S_IMODE((short / SOCKET).stat().st_mode))
        assert flying(short.parent) == (short,)

    flown(fly, short, talk)
    assert seen == [0o600]
    assert not (short / SOCKET).exists() and flying(short.parent) == ()


@pytest.mark.parametrize(
    "line", [b"\n", b"[]\n", b"{\n", b'{"command": 7}\n', b'{"command": "fly"}\n', b"x" * 9000 + b"\n"]
)
def test_nonsense_on_the_socket_harms_nothing(fly: Any, short: Path, line: bytes) -> None:
    def send() -> bytes:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.connect(str(short / SOCKET))
            connection.sendall(line)
            connection.shutdown(socket.SHUT_WR)
            try:
                return connection.recv(4096)
            except ConnectionError:
                return b""

    async def talk(executive: Any) -> None:
        answer = await asyncio.to_thread(send)
        assert not answer or json.loads(answer)["done"] is False
        assert (await told(short, "status")).done

    flown(fly, short, talk)


def test_a_deep_folder_has_a_socket_too(fly: Any, tmp_path: Path) -> None:
    deep = tmp_path / ("d" * 60) / ("e" * 60)
    deep.mkdir(parents=True)

    async def talk(executive: Any) -> None:
        assert (await told(deep, "status")).done

    flown(fly, deep, talk)


def test_where_nothing_flies_one_line_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(OperatorError, match="no run is being flown"):
        tell(tmp_path, "status")
    for command in ("status", "pause", "resume", "step", "abort"):
        assert main([command, "--record", str(tmp_path)]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "no run is being flown" in error


def test_the_commands_speak_to_the_one_run_that_flies(
    fly: Any, short: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    logs = str(short.parent)

    async def talk(executive: Any) -> None:
        assert await asyncio.to_thread(main, ["pause", "--record", logs]) == 0
        await until(executive, "holding")
        assert await asyncio.to_thread(main, ["pause", "--record", logs]) == 1
        assert await asyncio.to_thread(main, ["status", "--record", logs, "--json"]) == 0
        assert await asyncio.to_thread(main, ["status", "--record", logs]) == 0

    flown(fly, short, talk)
    output = capsys.readouterr()
    assert "pausing" in output.out and "cannot be paused in holding" in output.err
    assert '"path": "holding"' in output.out
    assert "resumed → inspect.out" in output.out


# Autonomy


ASKING = {
    "one": {"do": "finish", "on": {"done": {"to": "two", "confirm": True}, "abort": "aborted"}},
    "two": {"do": "finish", "on": {"done": "completed", "abort": "aborted"}},
    "completed": {"final": "completed"},
    "aborted": {"final": "aborted"},
}


@pytest.mark.parametrize("autonomy, asked", [("full", []), ("confirm", ["two"]), ("manual", ["two", "completed"])])
def test_the_autonomy_decides_what_is_asked(fly: Any, autonomy: str, asked: list[str]) -> None:
    questions: list[str] = []

    async def ask(question: Any) -> bool:
        questions.append(question.target)
        return True

    assert fly(ASKING, ask=ask, autonomy=autonomy).run().outcome == "completed"
    assert questions == asked


def test_a_person_who_never_answers_does_not_keep_the_flight_from_ending(fly: Any) -> None:
    gone = threading.Event()

    def confirm(text: str) -> bool:
        return gone.wait(1000.0)

    flight = fly(ASKING, ask=asking(confirm), autonomy="confirm")

    async def beside(executive: Any) -> None:
        while executive.status().waiting is None:  # noqa: ASYNC110 (it is the product's own public face)
            await asyncio.sleep(0.005)
        executive.interrupt()

    assert flight.run_on_the_wall(beside).outcome == "aborted"
    assert not gone.is_set()
    gone.set()


@pytest.mark.parametrize("answer", [True, False])
def test_a_terminal_answers_from_its_own_thread(fly: Any, answer: bool) -> None:
    asked: list[str] = []

    def confirm(text: str) -> bool:
        asked.append(text)
        if not answer:
            raise EOFError
        return True

    flight = fly(ASKING, ask=asking(confirm), autonomy="confirm")

    async def beside(executive: Any) -> None:
        while not asked:  # noqa: ASYNC110 (it is another thread's)
            await asyncio.sleep(0.005)
        if not answer:
            await until(executive, "one")
            executive.interrupt()

    assert flight.run_on_the_wall(beside).outcome == ("completed" if answer else "aborted")
    assert asked == ["one: done → two?"]


def test_a_safety_event_waits_for_no_answer(fly: Any) -> None:
    async def never(question: Any) -> bool:
        await asyncio.sleep(1e6)
        return True

    flight = fly(ASKING, ask=never, autonomy="manual", at=[(5.0, lambda executive: executive.raise_event("wind_high"))])
    assert flight.run().outcome == "aborted"


def test_a_key_answers_the_question_and_a_no_keeps_the_vehicle_holding(fly: Any) -> None:
    where: list[str] = []
    flight = fly(
        ASKING,
        autonomy="confirm",
        at=[
            (3.0, lambda executive: where.append(executive.status().waiting)),
            (4.0, lambda executive: executive.raise_event("step", by="keyboard")),
        ],
    )
    assert flight.run().outcome == "completed"
    assert where == ["one: done → two?"]
    assert [fields["who"] for kind, fields in flight.journal if kind == "operator"] == ["keyboard"]

    refused = fly(
        ASKING,
        autonomy="confirm",
        name="refused.jsonl",
        at=[
            (3.0, lambda executive: executive.confirm(False)),
            (20.0, lambda executive: executive.raise_event("abort")),
        ],
    )
    assert refused.run().outcome == "aborted"
    assert refused.walked == ["aborted"]


def test_after_a_no_the_operator_may_still_say_yes(fly: Any) -> None:
    shown: list[str] = []
    flight = fly(
        ASKING,
        autonomy="confirm",
        at=[
            (3.0, lambda executive: executive.confirm(False)),
            (4.0, lambda executive: shown.extend((executive.state, executive.status().text))),
            (5.0, lambda executive: executive.raise_event("step", by="keyboard")),
        ],
    )
    assert flight.run().outcome == "completed"
    assert shown == ["one", "done was refused; `step` follows it after all"]


def test_thinking_it_over_is_not_a_deadline_missed(fly: Any) -> None:
    states = {**ASKING, "one": {**ASKING["one"], "timeout_s": 10.0}}
    flight = fly(states, autonomy="confirm", at=[(60.0, lambda executive: executive.confirm(True))])
    assert flight.run().outcome == "completed"


def test_after_an_abort_nothing_is_asked_any_more(fly: Any) -> None:
    states = {
        "one": {"do": "wait", "on": {"abort": "home"}},
        "home": {"do": "finish", "on": {"done": {"to": "aborted", "confirm": True}}},
        "aborted": {"final": "aborted"},
    }
    flight = fly(states, autonomy="manual", at=[(2.0, lambda executive: executive.raise_event("abort"))])
    assert flight.run().outcome == "aborted"
