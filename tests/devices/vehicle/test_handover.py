"""A vehicle whose program was killed waits for another, is taken up by it alone, and never stays for ever."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from devices.vehicle.handover import NOTE_FILE, StillFlownError, VehicleNote, adopt, note_in
from devices.vehicle.keeper import Guardian, Keeper
from devices.vehicle.settings import ProcessSettings
from devices.vehicle.spawn import spawn
from devices.vehicle.truth_channel import TruthClient

ROOT = Path(__file__).resolve().parents[3]

PROGRAM = """
import sys, time
from pathlib import Path
from devices.vehicle.settings import ProcessSettings
from devices.vehicle.spawn import spawn
spawn(ProcessSettings(folder=Path(sys.argv[1]), speed=4, watch_parent=True)).note.write(Path(sys.argv[1]))
print("flies", flush=True)
time.sleep(600)
"""


@pytest.fixture
def killed(tmp_path):
    """The note of a vehicle whose program was killed; both are gone after the test."""
    program = subprocess.Popen([sys.executable, "-c", PROGRAM, tmp_path], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    note = None
    try:
        assert program.stdout.readline() == "flies\n"
        note = note_in(tmp_path)
        program.kill()
        program.wait()
        yield note
    finally:
        program.kill()
        program.wait()
        program.stdout.close()
        if note is not None and Guardian(note.pid).alive:
            os.kill(note.pid, signal.SIGKILL)


def test_the_next_program_takes_it_up_and_has_its_truth_from_then_on(killed, tmp_path):
    elsewhere = tmp_path / "next"
    vehicle = adopt(killed, speed=8, folder=elsewhere)
    assert vehicle is not None and vehicle.alive
    client = TruthClient(vehicle.truth_port)
    began = client.pose().time_s
    while client.pose().time_s < began + 2:
        time.sleep(0.02)
    with pytest.raises(StillFlownError, match="still being flown"):
        adopt(killed, speed=8, folder=tmp_path / "third")
    client.close()
    vehicle.stop()
    assert not vehicle.alive
    rows = (elsewhere / "truth.csv").read_text().splitlines()
    assert len(rows) > 10 and float(rows[1].split(",")[0]) >= began - 1
    assert [json.loads(line)["kind"] for line in (elsewhere / "vehicle_events.jsonl").read_text().splitlines()] == [
        "stopped"
    ]


def test_another_vehicle_on_its_port_is_not_taken_for_it(killed, tmp_path):
    assert adopt(killed.model_copy(update={"token": "another"}), speed=4, folder=tmp_path / "next") is None
    assert adopt(killed.model_copy(update={"token": ""}), speed=4, folder=tmp_path / "next") is None
    assert Guardian(killed.pid).alive and not (tmp_path / "next").exists()


def test_one_that_is_gone_is_not_waited_for(tmp_path):
    vehicle = spawn(ProcessSettings(watch_parent=True))
    vehicle.stop()
    assert adopt(vehicle.note, speed=1, folder=tmp_path) is None


def test_a_vehicle_of_a_living_program_is_not_handed_over(tmp_path):
    vehicle = spawn(ProcessSettings(watch_parent=True))
    try:
        with pytest.raises(StillFlownError):
            adopt(vehicle.note, speed=1, folder=tmp_path)
    finally:
        vehicle.stop()


@pytest.mark.parametrize("content", ["", '{"pid": 1', "[]", '{"pid": 1, "truth_port": "x"}', "\0\0\0"])
def test_a_torn_note_is_no_note(tmp_path, content):
    (tmp_path / NOTE_FILE).write_text(content)
    assert note_in(tmp_path) is None


def test_a_note_comes_back_as_it_was_written(tmp_path):
    note = VehicleNote(pid=7, truth_port=8, system_address="udpout://127.0.0.1:9", token="t")
    note.write(tmp_path)
    assert note_in(tmp_path) == note


def ended_process():
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_an_orphan_waits_longer_in_the_air_than_on_the_ground():
    flying, landed = Keeper(ended_process(), orphan_s=120), Keeper(ended_process(), orphan_s=120)
    assert flying.look(0.0, armed=True) == landed.look(0.0, armed=False) == (True, None)
    assert flying.look(119.0, armed=True) == (False, None)
    assert flying.look(121.0, armed=True)[1] is not None
    assert landed.look(19.0, armed=False) == (False, None)
    assert landed.look(21.0, armed=False)[1] is not None


def test_it_is_nobody_s_orphan_once_it_was_taken_up():
    keeper = Keeper(ended_process(), orphan_s=10)
    keeper.look(0.0, armed=True)
    keeper.hand_over(os.getpid())
    assert keeper.kept and keeper.look(1000.0, armed=True) == (False, None)
    assert Keeper(None, orphan_s=0).look(1000.0, armed=False) == (False, None)
