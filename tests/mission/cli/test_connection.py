"""A vehicle that is not there, and a port that is not free: one line, exit code 3, nothing left behind."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from tests.mission.cli.conftest import Call
from tests.mission.cli.program import ROOT

BLADE = ROOT / "missions" / "v80_blade.yaml"
SITL = ROOT / "missions" / "rigs" / "px4_sitl.yaml"


def test_a_connection_that_never_answers(call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from mission.executive import assembly

    monkeypatch.setattr(assembly, "CONNECT_S", 1.0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        system = f"udpin://127.0.0.1:{probe.getsockname()[1]}"
    said = call("run", BLADE, "--rig", SITL, "--system", system, "--record", tmp_path / "logs", "--headless")
    said.assert_one_line(3)
    assert system in said.err
    assert list((tmp_path / "logs").iterdir()) == []


def test_a_port_that_another_program_has(call: Call, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        system = f"udpin://127.0.0.1:{port}"
        said = call("run", BLADE, "--rig", SITL, "--system", system, "--record", tmp_path / "logs", "--headless")
    said.assert_one_line(3)
    assert str(port) in said.err
    assert "in use" in said.err
    assert list((tmp_path / "logs").iterdir()) == []


@pytest.mark.parametrize("system", ["nonsense", "udpin://", "udpin://127.0.0.1:99999", "carrier-pigeon://x:1"])
def test_an_address_that_is_none(call: Call, tmp_path: Path, system: str) -> None:
    said = call("run", BLADE, "--rig", SITL, "--system", system, "--record", tmp_path / "logs", "--headless")
    assert said.code in (2, 3)
    said.assert_one_line(said.code)
    assert system in said.err
    assert not (tmp_path / "logs").exists() or list((tmp_path / "logs").iterdir()) == []
