"""The truth of a flight, on flights whose truth is known beforehand."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml

from devices.world.run_files import RunFiles
from devices.world.settings import SurveyError
from devices.world.truth import Flight, Pass, Photograph, coverage, flight_truth, truth_of_run
from devices.world.turbine import TurbineShape
from vision.camera import Camera
from vision.capture import rotation_of

CAMERA = Camera(612, 512, 616.0, 616.0, 305.5, 255.5)
MOUNT = np.array([0.12, 0.0, 0.05])
HEADING = np.deg2rad(8.0)


@pytest.fixture(scope="module")
def shape() -> TurbineShape:
    return TurbineShape(azimuth_deg=45.0, heading_deg=8.0, north_m=60.0, east_m=10.0)


def along_the_blade(shape: TurbineShape, stations: np.ndarray, distance: float, sideways: float = 0.0) -> Flight:
    """One second a sample before the blade's axis, looking along the heading."""
    count = len(stations)
    blade = np.column_stack([stations, np.full(count, sideways), np.full(count, -distance)])
    return Flight(
        np.arange(count, dtype=float),
        shape.blade_frame().to_ned(blade),
        np.tile([0.0, 0.0, HEADING], (count, 1)),
        np.tile([HEADING, 0.0], (count, 1)),
        np.ones(count, bool),
    )


def test_clearance_is_the_least_distance_of_the_armed_flight(shape):
    flight = along_the_blade(shape, np.array([10.0, 20.0, 30.0]), 4.0)
    flight.position[1] = shape.hub - 7.0 * shape.rotation[:, 0]  # before the spinner's nose
    truth = flight_truth(flight, shape, CAMERA, MOUNT)
    assert 3.0 < truth["min_clearance_m"] < 4.0 and not truth["collision"]
    flight.armed[[0, 2]] = False
    nose = 7.0 - 1.8 * np.cos(np.deg2rad(5.0))
    assert flight_truth(flight, shape, CAMERA, MOUNT)["min_clearance_m"] == pytest.approx(nose, abs=0.05)


def test_a_vehicle_inside_the_rotors_metal_has_collided(shape):
    flight = along_the_blade(shape, np.array([15.0, 20.0]), 0.3)
    assert flight_truth(flight, shape, CAMERA, MOUNT)["collision"] is True


def test_standoff_is_measured_from_the_lens_and_only_during_the_passes(shape):
    stations = np.linspace(10.0, 30.0, 21)
    flight = along_the_blade(shape, stations, 3.0 + MOUNT[0])
    flight.position[:5] -= 20.0 * shape.rotation[:, 0]
    truth = flight_truth(flight, shape, CAMERA, MOUNT, passes=[Pass(5.0, 20.0, "leading")], target_m=3.0)
    # The nearest surface lies before the blade's axis by part of its thickness and by its twisted leading edge.
    assert 2.5 < truth["standoff_min_m"] < truth["standoff_max_m"] < 3.0
    assert truth["standoff_rmse_m"] == pytest.approx(
        np.sqrt(np.mean((np.array([truth["standoff_min_m"], truth["standoff_max_m"]]) - 3.0) ** 2)), abs=0.15
    )
    assert flight_truth(flight, shape, CAMERA, MOUNT)["standoff_rmse_m"] is None


@pytest.mark.parametrize("turn", [0.0, 120.0, 240.0])
def test_a_pass_is_measured_to_the_blade_that_it_followed(shape, turn):
    flight = along_the_blade(shape, np.linspace(8.0, 36.0, 29), 3.0 + MOUNT[0])
    # The same way before another blade: turned about the rotor's axis, which all three share.
    axis = shape.rotation @ rotation_of(0.0, -np.deg2rad(5.0), 0.0)[:, 0]
    around = flight.position - shape.hub
    angle = np.deg2rad(turn)
    turned = (
        around * np.cos(angle)
        + np.cross(axis, around) * np.sin(angle)
        + np.outer(around @ axis, axis) * (1 - np.cos(angle))
    )
    same = replace(flight, position=shape.hub + turned)
    truth = flight_truth(same, shape, CAMERA, MOUNT, passes=[Pass(0.0, 28.0, "leading")], target_m=3.0)
    assert 2.2 < truth["standoff_min_m"] < truth["standoff_max_m"] < 3.2


def test_a_claimed_tip_is_held_against_the_true_radius(shape):
    flight = along_the_blade(shape, np.array([20.0, 21.0]), 5.0)
    assert flight_truth(flight, shape, CAMERA, MOUNT, tip_radius_m=39.7)["tip_error_m"] == pytest.approx(0.3)
    assert flight_truth(flight, shape, CAMERA, MOUNT)["tip_error_m"] is None


def test_photographs_all_along_an_edge_cover_it_and_half_of_them_half(shape):
    stations = np.arange(1.5, 40.5, 0.5)
    flight = along_the_blade(shape, stations, 3.2, sideways=0.6)
    frames = [Photograph(t, "leading") for t in flight.t]
    assert coverage(flight, shape, CAMERA, MOUNT, frames, "leading") > 0.98
    half = coverage(flight, shape, CAMERA, MOUNT, frames[: len(frames) // 2], "leading")
    assert half == pytest.approx(0.5, abs=0.06)


def test_the_second_blade_is_covered_by_its_own_photographs_alone(shape):
    flight = along_the_blade(shape, np.arange(1.5, 40.5, 0.5), 3.2, sideways=0.6)
    before = replace(shape, azimuth_deg=shape.azimuth_deg - 120.0)  # then the one that is photographed comes second
    frames = [Photograph(t, "leading", blade=1) for t in flight.t]
    truth = flight_truth(flight, before, CAMERA, MOUNT, photographs=frames)
    assert [blade["coverage"]["leading"] > 0.98 for blade in truth["blades"]] == [False, True]
    assert truth["coverage"]["leading"] == pytest.approx(0.5, abs=0.1)
    assert "blades" not in flight_truth(flight, shape, CAMERA, MOUNT, photographs=[replace(f, blade=0) for f in frames])


def test_an_edge_outside_the_picture_or_of_the_other_side_is_not_covered(shape):
    stations = np.arange(6.0, 14.0, 0.5)  # the blade is wider than the picture here
    flight = along_the_blade(shape, stations, 3.2, sideways=0.9)
    leading = [Photograph(t, "leading") for t in flight.t]
    assert coverage(flight, shape, CAMERA, MOUNT, leading, "trailing") == 0.0
    trailing = [Photograph(t, "trailing") for t in flight.t]
    assert coverage(flight, shape, CAMERA, MOUNT, leading, "leading") > 0.2
    assert coverage(flight, shape, CAMERA, MOUNT, trailing, "trailing") < 0.05
    away = Flight(flight.t, flight.position, flight.attitude, flight.gimbal + np.array([np.pi, 0.0]), flight.armed)
    assert coverage(away, shape, CAMERA, MOUNT, leading, "leading") == 0.0


def test_an_edge_hidden_by_another_part_is_not_covered(shape):
    """From behind, nacelle and tower stand between the camera and the root of a blade that points down."""
    down = TurbineShape(azimuth_deg=180.0, heading_deg=8.0, north_m=60.0, east_m=10.0)
    seen = {}
    for name, side in (("front", -1.0), ("back", 1.0)):
        position = down.blade_frame().to_ned(np.array([20.0, 0.0, side * 25.0]))
        yaw = HEADING if name == "front" else HEADING + np.pi
        flight = Flight(
            np.array([0.0, 1.0]),
            np.tile(position, (2, 1)),
            np.tile([0.0, 0.0, yaw], (2, 1)),
            np.tile([yaw, 0.0], (2, 1)),
            np.ones(2, bool),
        )
        seen[name] = coverage(flight, down, CAMERA, MOUNT, [Photograph(0.5, "leading")], "leading")
    assert seen["back"] < seen["front"] - 0.2


def write_run(folder, shape_error: SurveyError, vehicle_ahead_s: float) -> None:
    """A run's folder as the parts leave it, of a flight along the true blade's leading edge."""
    turbine = {"hub_height_m": 78.0, "blade_length_m": 39.0, "root_radius_m": 1.0, "azimuth_deg": 45.0}
    site = {"turbine_north_m": 60.0, "turbine_east_m": 10.0, "turbine_heading_deg": 8.0, "ground_m": 0.0}
    document = {
        "turbine": turbine,
        "site": site,
        "rig": {"mount_m": MOUNT.tolist(), "camera": {"width": 612, "height": 512, "focal_px": 616.0}},
        "world": {"survey_error": shape_error.model_dump()},
        "states": {
            "inspect": {"states": {"leading": {"do": "follow_edge", "with": {"side": "leading", "standoff_m": 3.0}}}}
        },
    }
    (folder / "telemetry").mkdir(parents=True)
    (folder / "frames").mkdir()
    (folder / "mission.yaml").write_text(yaml.safe_dump(document))
    true = TurbineShape.of(turbine, site, shape_error)
    heading = np.deg2rad(true.heading_deg)
    t = np.arange(0.0, 60.0, 0.05)
    station = np.clip(1.5 + (t - 5.0) * 0.8, 1.5, 40.0)
    place = true.blade_frame().to_ned(np.column_stack([station, np.full_like(t, 0.6), np.full_like(t, -3.2)]))
    drift = np.array([1.0, -0.5, 0.3])
    rows = ["t,n,e,d,roll,pitch,yaw,gimbal_yaw,gimbal_pitch,mode,armed,estimated_n,estimated_e,estimated_d"]
    for now, true_place in zip(t, place, strict=True):
        numbers = [now + vehicle_ahead_s, *true_place, 0.0, 0.0, heading, heading, 0.0]
        told = ",".join(f"{value:.4f}" for value in true_place + drift)
        rows.append(",".join(f"{value:.4f}" for value in numbers) + f",OFFBOARD,1,{told}")
    (folder / "telemetry" / "truth.csv").write_text("\n".join(rows) + "\n12.0,tor")
    rows = ["t,north,east,down"]
    rows += [
        ",".join(f"{value:.3f}" for value in (now, *(p + drift))) for now, p in zip(t[::2], place[::2], strict=True)
    ]
    (folder / "telemetry" / "telemetry.csv").write_text("\n".join(rows) + "\n")
    journal = [
        {"seq": 0, "t": 0.0, "kind": "start", "state": "preflight"},
        {"seq": 1, "t": 5.0, "kind": "transition", "event": "aligned", "from": "preflight", "to": "inspect.leading"},
        {"seq": 2, "t": 54.0, "kind": "memory", "tip_station_m": 39.9},
        {"seq": 3, "t": 54.0, "kind": "transition", "event": "done", "from": "inspect.leading", "to": "completed"},
    ]
    (folder / "journal.jsonl").write_text("\n".join(json.dumps(line) for line in journal) + '\n{"seq": 4, "t"')
    frames = [
        {"file": f"{n}_left.jpg", "stamp_s": float(s), "side": "leading", "accepted": bool(s < 45.0), "sharpness": 0.8}
        for n, s in enumerate(np.arange(5.0, 54.0, 0.5))
    ]
    (folder / "frames" / "frames.jsonl").write_text("\n".join(json.dumps(line) for line in frames) + "\n")


@pytest.mark.parametrize("ahead_s", [0.0, 7.3])
def test_a_runs_folder_holds_its_truth_whatever_the_vehicles_clock_says(tmp_path, ahead_s):
    error = SurveyError(distance_m=1.5, bearing_deg=130.0, heading_deg=3.0, azimuth_deg=2.0)
    write_run(tmp_path, error, ahead_s)
    run = RunFiles.read(tmp_path)
    assert run is not None
    assert run.flight.t[0] == pytest.approx(0.0, abs=0.03)
    assert [(one.start_s, one.end_s, one.side) for one in run.passes] == [(5.0, 54.0, "leading")]
    truth = truth_of_run(tmp_path)
    assert truth is not None
    assert truth["tip_error_m"] == pytest.approx(0.1)
    assert 1.5 < truth["min_clearance_m"] < 2.5  # the spinner, at the start
    assert truth["standoff_rmse_m"] < 0.5
    # The last accepted photograph, of 44.5 s, looks at station 33 and 1.2 m beyond.
    assert truth["coverage"]["leading"] == pytest.approx((34.3 - 1.6) / 38.45, abs=0.03)


def test_a_folder_without_a_simulated_vehicle_has_no_truth(tmp_path):
    assert truth_of_run(tmp_path) is None
    (tmp_path / "mission.yaml").write_text("mission: square\n")
    assert truth_of_run(tmp_path) is None
