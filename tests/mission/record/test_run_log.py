"""The run log takes what is said anywhere, and the console stays quiet."""

from __future__ import annotations

import json
import logging
import warnings
from pathlib import Path

import pytest
import structlog

from mission.record.run_log import RunLog


def test_everything_that_is_said_becomes_a_json_line_and_nothing_reaches_the_console(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log = RunLog(tmp_path / "run.log.jsonl")
    log.logger.info("transition", state="inspect.survey", t=1.5)
    structlog.get_logger().warning("from anywhere")
    logging.getLogger("library").warning("a library speaks of %s", "this")
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.warn("mean of empty slice", RuntimeWarning, stacklevel=1)
    try:
        raise ZeroDivisionError("of all things")
    except ZeroDivisionError:
        log.logger.exception("executive failed")
    log.close()
    lines = [json.loads(line) for line in (tmp_path / "run.log.jsonl").read_text().splitlines()]
    assert [line["level"] for line in lines] == ["info", "warning", "warning", "warning", "error"]
    assert lines[0]["event"] == "transition"
    assert lines[0]["state"] == "inspect.survey"
    assert lines[2]["event"] == "a library speaks of this"
    assert "mean of empty slice" in lines[3]["event"]
    assert lines[4]["exception"][0]["exc_type"] == "ZeroDivisionError"
    assert all("timestamp" in line for line in lines)
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_does_not_reach_the_one_who_logs() -> None:
    log = RunLog(Path("/dev/full"))
    for _ in range(3):
        log.logger.error("nobody hears this")


def test_after_the_run_logging_is_as_it_was(tmp_path: Path) -> None:
    handlers = list(logging.getLogger().handlers)
    log = RunLog(tmp_path / "run.log.jsonl")
    log.close()
    assert logging.getLogger().handlers == handlers
    assert not structlog.is_configured()
