"""The tracker's claims in a run's record, held against the truth of a made-up simulated flight."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from devices.vehicle.truth_log import COLUMNS
from devices.world.raycast import cast
from devices.world.turbine import TurbineShape
from mission.language.document import load
from mission.record.consistency import consistency_of
from mission.record.folder import create
from mission.record.history import RunHistory
from vision.capture import camera_pose

ROOT = Path(__file__).parents[3]


@pytest.fixture
def run(tmp_path: Path) -> RunHistory:
    """A vehicle that hangs three metres before the blade for 40 s, and a tracker that errs by its sigma of 2 cm."""
    mission = load(ROOT / "missions" / "v80_blade.yaml")
    folder = create(tmp_path, "v80_blade", mission.resolved_yaml)
    document = yaml.safe_load(mission.resolved_yaml)
    shape = TurbineShape.of(document["turbine"], document["site"], mission.world.survey_error)
    frame = shape.blade_frame()
    lens = frame.to_ned(np.array([20.0, 0.0, -3.0]))
    yaw, pitch = np.arctan2(frame.depth[1], frame.depth[0]), -np.arcsin(frame.depth[2])
    mount = np.array(document["rig"]["mount_m"])
    zero = camera_pose(np.zeros(3), np.zeros(3), np.array([yaw, pitch]), mount)
    place = lens - zero.position
    rows = [",".join(COLUMNS)]
    for t in np.arange(0.0, 42.0, 0.05):
        known = dict(zip("ned", place, strict=True)) | {"t": t, "gimbal_yaw": yaw, "gimbal_pitch": pitch}
        rows.append(",".join("HOLD" if name == "mode" else f"{known.get(name, 0.0):.5f}" for name in COLUMNS))
    folder.telemetry.mkdir(exist_ok=True)
    folder.truth.write_text("\n".join(rows) + "\n")
    true = float(cast(shape.mesh, lens, zero.rotation[:, 0], 40.0)[0][0])
    rng = np.random.default_rng(0)
    with (folder.telemetry / "vision.jsonl").open("w") as file:
        for t in np.arange(1.0, 41.0, 0.2):
            estimate = {"age_s": 0.0, "distance_m": true + rng.normal(0, 0.02), "sigma_m": 0.02}
            nis = float(rng.chisquare(7))
            file.write(
                json.dumps(
                    {"stamp": t, "side": "leading", "accepted": True, "nis": nis, "dof": 7, "estimate": estimate}
                )
                + "\n"
            )
    return RunHistory(folder)


def test_right_claims_are_told_to_hold(run: RunHistory) -> None:
    found = consistency_of(run)
    assert found["samples"] == 200
    assert found["interval"][0] < found["nis_per_dof"] < found["interval"][1]
    covered = found["distance"]["following"]
    assert covered["samples"] == 200
    assert covered["rmse_m"] == pytest.approx(0.02, rel=0.2)
    assert covered["within_1_sigma"] == pytest.approx(0.683, abs=0.09)
    assert covered["within_2_sigma"] == pytest.approx(0.954, abs=0.04)
    assert found["distance"]["bridging"] is None


def test_without_truth_there_is_no_coverage(run: RunHistory) -> None:
    run.folder.truth.unlink()
    assert "distance" not in consistency_of(run)
