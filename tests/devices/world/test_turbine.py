"""The true turbine has the shape of a V80 and stands where site, file and survey error say."""

import numpy as np
import pytest

from devices.world.nearest import distances
from devices.world.settings import SurveyError
from devices.world.turbine import BLADES, INSPECTED, TOWER, TurbineShape
from vision.capture import rotation_of

FILE = {"name": "Vestas V80", "hub_height_m": 78.0, "overhang_m": 4.2, "azimuth_deg": 45.0, "tilt_deg": 5.0}
SITE = {"name": "coast", "turbine_north_m": 60.0, "turbine_east_m": 10.0, "turbine_heading_deg": 8.0, "ground_m": 2.0}


def test_the_survey_error_moves_and_turns_the_true_turbine():
    error = SurveyError(distance_m=1.5, bearing_deg=90.0, heading_deg=3.0, azimuth_deg=2.0)
    shape = TurbineShape.of(FILE, SITE, error)
    assert (shape.north_m, shape.east_m) == pytest.approx((60.0, 11.5))
    assert (shape.heading_deg, shape.azimuth_deg) == (11.0, 47.0)
    back = np.array([np.cos(np.deg2rad(11.0)), np.sin(np.deg2rad(11.0)), 0.0])
    assert shape.hub == pytest.approx(np.array([60.0, 11.5, -80.0]) - 4.2 * back)


def test_the_chord_grows_to_its_largest_at_a_fifth_of_the_span_and_tapers_to_a_closed_tip():
    blade = TurbineShape().blade
    stations = np.linspace(1.0, 40.0, 2000)
    chord = blade.chord_m(stations)
    assert chord[0] == pytest.approx(1.9) and chord.max() == pytest.approx(3.5, abs=1e-3)
    assert stations[chord.argmax()] == pytest.approx(1.0 + 0.2 * 39.0, abs=0.05)
    outer = stations > stations[chord.argmax()]
    assert np.all(np.diff(chord[outer]) < 0)
    assert blade.chord_m(np.array([39.5]))[0] == pytest.approx(0.53, abs=0.02)
    assert chord[-1] < 0.01


def test_the_root_is_round_and_the_tip_thin():
    outline = TurbineShape().blade.sections(np.array([1.0, 20.0, 39.0]))[..., 1:]
    round_root = np.linalg.norm(outline[0], axis=1)
    assert np.ptp(round_root) < 0.01 and round_root.mean() == pytest.approx(0.95, abs=0.01)
    for section, ratio in ((outline[1], (0.17, 0.26)), (outline[2], (0.14, 0.18))):
        middle = section - section.mean(axis=0)
        _, _, axes = np.linalg.svd(middle)
        chord, thickness = np.ptp(middle @ axes.T, axis=0)
        assert ratio[0] < thickness / chord < ratio[1]


@pytest.mark.parametrize("azimuth", [0.0, 60.0, 135.0, 250.0])
def test_the_blade_points_where_its_azimuth_says_and_its_leading_edge_goes_first(azimuth):
    shape = TurbineShape(azimuth_deg=azimuth, heading_deg=30.0)
    tip = (shape.tip_point - shape.hub) @ shape.rotation
    assert np.hypot(*tip[1:]) == pytest.approx(40.0, abs=0.2)
    off = np.rad2deg(np.arctan2(tip[1], -tip[2])) - azimuth
    assert (off + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.3)
    assert np.linalg.norm(shape.tip_point - shape.hub) == pytest.approx(40.0, abs=0.01)
    # Turned clockwise by a little, the middle of the blade moves toward the leading edge.
    leading, trailing = shape.edges(np.array([20.0]))
    ahead = TurbineShape(azimuth_deg=azimuth + 1.0, heading_deg=30.0)
    moved = ahead.blade_frame().to_ned(np.array([20.0, 0, 0])) - shape.blade_frame().to_ned(np.array([20.0, 0, 0]))
    assert moved @ (leading - trailing)[0] > 0


def test_cone_and_tilt_keep_the_blade_away_from_the_tower():
    down, up = TurbineShape(azimuth_deg=180.0), TurbineShape(azimuth_deg=0.0)
    for shape in (down, up):
        tilt, cone = np.deg2rad(5.0), np.deg2rad(2.0)
        forward = (shape.hub - shape.tip_point) @ shape.rotation[:, 0]
        side = 1 if shape is down else -1
        assert forward == pytest.approx(40.0 * np.sin(cone + side * tilt), abs=0.05)


@pytest.mark.parametrize(("tip", "chord_near_end"), [("round", 0.25), ("square", 0.5), ("spiked", 0.05)])
def test_tips_of_every_shape_end_at_the_same_radius(tip, chord_near_end):
    shape = TurbineShape(tip=tip)
    stations = shape.blade_frame().to_blade(shape.mesh.vertices[shape.mesh.triangles[shape.mesh.part == INSPECTED]])
    assert stations[..., 0].max() == pytest.approx(40.0, abs=1e-6)
    assert shape.blade.chord_m(np.array([39.95]))[0] == pytest.approx(chord_near_end, abs=0.03)


def test_triangles_face_outward_and_three_blades_are_alike():
    mesh = TurbineShape(azimuth_deg=77.0, heading_deg=120.0).mesh
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    assert np.all(np.einsum("ij,ij->i", normal, mesh.normals[mesh.triangles].sum(axis=1)) > 0)
    volumes = [np.einsum("ij,ij->i", a, np.cross(b, c))[mesh.part == part].sum() / 6 for part in BLADES]
    offsets = [np.abs(volume) for volume in volumes]
    areas = [np.linalg.norm(normal[mesh.part == part], axis=1).sum() / 2 for part in BLADES]
    assert np.ptp(areas) < 1e-6 and min(offsets) > 0 and 150 < areas[0] < 250


def test_distances_agree_with_an_independent_library():
    trimesh = pytest.importorskip("trimesh")
    shape = TurbineShape(azimuth_deg=200.0)
    random = np.random.default_rng(1)
    points = shape.hub + random.uniform(-1, 1, (8, 3)) * [15.0, 25.0, 25.0]
    mesh = shape.mesh
    corners = mesh.vertices[mesh.triangles]
    expected = [
        np.linalg.norm(trimesh.triangles.closest_point(corners, np.tile(one, (len(corners), 1))) - one, axis=1).min()
        for one in points
    ]
    assert distances(mesh, points) == pytest.approx(expected, abs=1e-6)
    assert np.all(distances(mesh, points, (INSPECTED,)) >= distances(mesh, points) - 1e-9)


def test_the_turbine_turns_as_a_rigid_body():
    one, other = TurbineShape(heading_deg=0.0), TurbineShape(heading_deg=90.0)
    turn = rotation_of(0.0, 0.0, np.pi / 2)
    above = np.unique(one.mesh.triangles[one.mesh.part != TOWER])  # the tower is the same from every side
    assert other.mesh.vertices[above] == pytest.approx(one.mesh.vertices[above] @ turn.T, abs=1e-9)
