"""The vehicle's process: it paces itself, tells the truth to the cameras, outlives its parent just long enough, and
ends."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from devices.vehicle.settings import LinkSettings, ProcessSettings
from devices.vehicle.spawn import SpawnError, spawn
from devices.vehicle.truth_channel import TruthClient, TruthError
from devices.vehicle.udp_link import bind_udp

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def vehicle(tmp_path):
    running = []

    def start(**settings):
        running.append(spawn(ProcessSettings(**({"folder": tmp_path, "speed": 20} | settings))))
        return running[-1]

    yield start
    for process in running:
        process.stop()


def events(folder):
    return [json.loads(line) for line in (folder / "vehicle_events.jsonl").read_text().splitlines()]


def wait_for(condition, within_s=60.0):
    deadline = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.02)


def test_simulated_time_runs_and_the_truth_is_told(vehicle, tmp_path):
    process = vehicle()
    client = TruthClient(process.truth_port)
    first = client.pose()
    wait_for(lambda: client.pose().time_s > first.time_s + 2)
    assert abs(client.pose().position[0]) < 0.01
    process.stop()
    assert not process.alive
    assert process.process.returncode == 0
    rows = (tmp_path / "truth.csv").read_text().splitlines()
    assert rows[0].startswith("t,n,e,d,roll,pitch,yaw,gimbal_yaw,gimbal_pitch,mode,armed")
    times = [float(row.split(",")[0]) for row in rows[1:]]
    assert len(times) / (times[-1] - times[0]) == pytest.approx(20, rel=0.1)
    assert events(tmp_path)[-1]["kind"] == "stopped"
    with pytest.raises(TruthError, match="does not answer"):
        client.pose()
    client.close()


def test_faults_can_be_switched_and_wrong_switches_are_explained(vehicle, tmp_path):
    client = TruthClient(vehicle().truth_port)
    client.command("gps_jump", north_m=2.0, east_m=0.0)
    client.command("battery", percent=30)
    with pytest.raises(TruthError, match="no such switch"):
        client.command("gravity", up=True)
    with pytest.raises(TruthError, match="percentage"):
        client.command("battery", percentage=3)
    wait_for(lambda: {"gps_jump", "battery_drop"} <= {event["kind"] for event in events(tmp_path)})
    client.close()


def test_a_port_in_use_is_one_clear_line():
    taken = bind_udp("127.0.0.1", 0)
    port = taken.getsockname()[1]
    with pytest.raises(SpawnError, match=f"UDP port {port} on 127.0.0.1 is in use"):
        spawn(ProcessSettings(links=(LinkSettings(local_port=port),)))
    taken.close()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [('{"speed": -1}', "speed"), ("not json", "JSON"), ('{"vehicle": {"wind": {"mean": 3}}}', "vehicle.wind.mean")],
)
def test_a_wrong_configuration_is_one_line(tmp_path, text, complaint):
    config = tmp_path / "vehicle.json"
    config.write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "devices.vehicle", "--config", config], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


FLYING_PARENT = """
import sys, time
from pathlib import Path
from pymavlink.dialects.v20 import development as m
from devices.vehicle.settings import ProcessSettings
from devices.vehicle.spawn import spawn
from devices.vehicle.truth_channel import TruthClient
import socket
v = spawn(ProcessSettings(folder=Path(sys.argv[1]), speed=20, watch_parent=True, orphan_s=3))
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM); s.connect(("127.0.0.1", v.link_ports[0]))
mav = m.MAVLink(None, 1, 195)
send = lambda x: s.send(x.pack(mav))
order = lambda n, *p: send(m.MAVLink_command_long_message(1, 1, n, 0, *p, *(0,) * (7 - len(p))))
truth = TruthClient(v.truth_port)
while truth.pose().time_s < 5: time.sleep(0.01)
order(400, 1); order(22, 0, 0, 0, 0, 0, 0, 488 + 10)
while truth.pose().position[2] > -9: time.sleep(0.01)
print(v.process.pid, flush=True)
mode = False
while True:
    send(m.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, 0b100111111000, 2, 0, -10, 0, 0, 0, 0, 0, 0, 0, 0))
    if not mode: order(176, 1, 6, 0); mode = True
    time.sleep(0.02)
"""


def test_when_its_parent_is_killed_its_own_failsafe_acts_and_then_it_ends(tmp_path):
    command = [sys.executable, "-c", FLYING_PARENT, tmp_path]
    parent = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    child = 0
    try:
        child = int(parent.stdout.readline())
        log = tmp_path / "vehicle_events.jsonl"
        wait_for(lambda: '"OFFBOARD"' in log.read_text())
        parent.send_signal(signal.SIGKILL)
        parent.wait()
        wait_for(lambda: '"stopped"' in log.read_text())
        wait_for(lambda: not alive(child))
    finally:
        parent.kill()
        parent.wait()
        parent.stdout.close()
        if child and alive(child):
            os.kill(child, signal.SIGKILL)
    assert "parent_died" in [event["kind"] for event in events(tmp_path)]
    failsafe = [event for event in events(tmp_path) if event["kind"] == "failsafe"][-1]
    assert failsafe["reason"] == "offboard_lost"
    assert failsafe["action"] == "HOLD"
    assert failsafe["t"] - failsafe["setpoint_s"] == pytest.approx(20, abs=0.1), "one wall second at speed 20"


def alive(pid):
    """Whether the process runs; one that has ended and was not yet reaped does not."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{pid}/stat")
    return not status.exists() or status.read_text().rpartition(")")[2].split()[0] != "Z"
