"""What the tests of the commands share."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from mission.cli.main import main
from tests.mission.cli.program import Said

Call = Callable[..., Said]


@pytest.fixture
def call(capfd: pytest.CaptureFixture[str]) -> Call:
    """`mission ARGUMENTS…` in this process."""

    def run(*arguments: object) -> Said:
        capfd.readouterr()
        code = main([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        return Said(code, out, err)

    return run
