"""`mission simulate` runs the vehicle for any MAVLink client, and says plainly what is wrong."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from devices.vehicle.truth_channel import TruthClient
from devices.vehicle.udp_link import bind_udp

ROOT = Path(__file__).resolve().parents[3]
COMMAND = (sys.executable, "-m", "mission.cli.main", "simulate")


def free_port():
    with bind_udp("127.0.0.1", 0) as udp:
        return udp.getsockname()[1]


def test_it_announces_its_ports_flies_in_the_missions_world_and_stops_on_ctrl_c(tmp_path):
    options = ("--listen", "0", "--port", str(free_port()), "--station-port", str(free_port()), "--speed", "10")
    process = subprocess.Popen(
        [*COMMAND, *options, "--mission", "missions/v80_blade.yaml", "--record", tmp_path],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        said = json.loads(process.stdout.readline())
        assert [link["role"] for link in said["links"]] == ["onboard", "gcs"]
        truth = TruthClient(said["truth_port"])
        assert truth.pose().position == pytest.approx([0, 0, 0], abs=0.01)
        truth.close()
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert (tmp_path / "truth.csv").exists()


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (("--speed", "0"), "speed"),
        (("--set", "world.seed=3"), "--mission"),
        (("--mission", "nowhere.yaml"), "nowhere.yaml"),
        (("--listen", "0", "--station-port", "0", "--port", "14999", "--record", "/dev/null/x"), "/dev/null"),
    ],
)
def test_a_wrong_option_is_one_line_and_exit_two(options, complaint):
    done = subprocess.run([*COMMAND, *options], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_a_port_in_use_is_one_line_and_exit_two():
    with bind_udp("127.0.0.1", 0) as taken:
        port = str(taken.getsockname()[1])
        options = ("--listen", port, "--port", "14999", "--station-port", "0")
        done = subprocess.run([*COMMAND, *options], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert f"UDP port {port} on 127.0.0.1 is in use" in done.stderr
