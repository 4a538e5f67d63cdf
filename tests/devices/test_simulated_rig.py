"""The simulated rig photographs the simulated world from the vehicle's true pose."""

import numpy as np
import pytest

from devices.rig import CaptureError
from devices.simulated_rig import SimulatedRig
from devices.world.settings import WorldSettings
from devices.world.turbine import TurbineShape
from devices.world.world import TruePose, World
from vision.camera import Camera, LaserGrid, RigGeometry, StereoPair
from vision.capture import camera_pose

CAMERA = Camera(306, 256, 308.0, 308.0, 152.5, 127.5)
STEREO = StereoPair(CAMERA, CAMERA, translation=np.array([0.0, -0.2, 0.0]))
GEOMETRY = RigGeometry(STEREO, LaserGrid(position=np.array([0.0, 0.10, -0.06])))
MOUNT = np.array([0.12, 0.0, 0.05])
HEADING = np.deg2rad(8.0)
VIEWS = ("left", "right", "left_laser", "right_laser")


@pytest.fixture(scope="module")
def shape() -> TurbineShape:
    return TurbineShape(azimuth_deg=45.0, heading_deg=8.0, north_m=60.0, east_m=10.0)


class Flyer:
    """A vehicle that stands before the blade, and a clock."""

    def __init__(self, shape: TurbineShape, station: float = 20.0, distance: float = 3.2) -> None:
        self.t = 0.0
        self.velocity = np.zeros(3)
        self.position = shape.blade_frame().to_ned(np.array([station, 0.0, -distance]))

    def pose(self) -> TruePose:
        return TruePose(self.position, np.array([0.02, -0.03, HEADING]), np.array([HEADING, 0.0]), self.velocity)


def rig_of(shape: TurbineShape, flyer: Flyer, **world: object) -> SimulatedRig:
    settings = WorldSettings.model_validate(world)
    return SimulatedRig(World(shape, settings), GEOMETRY, MOUNT, flyer.pose, lambda: flyer.t)


def test_two_rigs_with_one_seed_deliver_the_same_bytes_and_another_seed_others(shape):
    one, other, different = (rig_of(shape, Flyer(shape), seed=seed) for seed in (1, 1, 2))
    for _ in range(2):
        first, second, third = one.capture(), other.capture(), different.capture()
        for view in VIEWS:
            assert np.array_equal(getattr(first, view), getattr(second, view))
        assert not np.array_equal(first.left, third.left)


def test_frames_carry_the_clock_and_no_pose(shape):
    flyer = Flyer(shape)
    rig = rig_of(shape, flyer)
    flyer.t = 12.5
    frames = rig.capture()
    assert frames.stamp_s == 12.5 and frames.pose is None
    dark = rig.capture(laser=False)
    assert dark.left is not None and dark.left_laser is None and dark.right_laser is None


def test_the_picture_is_taken_through_mount_and_gimbal(shape):
    flyer = Flyer(shape)
    rig = rig_of(shape, flyer, camera={"noise": 0.0, "vignette": 0.0})
    image = rig.capture(laser=False).left
    pose = camera_pose(flyer.position, flyer.pose().attitude, flyer.pose().gimbal, MOUNT)
    assert np.array_equal(image, rig.world.renderer.scenery(CAMERA, pose))


def test_a_laser_that_is_not_armed_takes_no_laser_images(shape):
    rig = rig_of(shape, Flyer(shape))
    rig.set_laser(False)
    with pytest.raises(CaptureError, match="laser"):
        rig.capture()
    assert rig.capture(laser=False).left is not None
    rig.set_laser(True)
    rig.close()
    with pytest.raises(CaptureError):
        rig.capture()


def test_moving_sideways_shifts_the_laser_images_by_the_way_flown_between_the_exposures(shape):
    flyer = Flyer(shape)
    quiet = {"noise": 0.0, "vignette": 0.0, "motion_blur": 0.0, "frame_gap_s": 0.1}
    rig = rig_of(shape, flyer, camera=quiet, faults={"laser_off": {}})
    flyer.velocity = np.array([-np.sin(HEADING), np.cos(HEADING), 0.0])  # a metre a second to the right
    frames = rig.capture()
    shifts = range(-20, 5)
    errors = [
        np.abs(np.roll(frames.left, s, axis=1).astype(float) - frames.left_laser)[30:-30, 40:-40].mean() for s in shifts
    ]
    expected = -CAMERA.fx * 0.1 / 2.9
    assert shifts[int(np.argmin(errors))] == pytest.approx(expected, abs=1.5)


@pytest.mark.parametrize("fault", ["images", "blackout"])
def test_no_images_while_the_fault_is_on_and_images_again_after_it(shape, fault):
    flyer = Flyer(shape)
    rig = rig_of(shape, flyer, faults={fault: {"state": "inspect.leading", "after_s": 10, "for_s": 15}})
    rig.world.enter_state("inspect.leading", 100.0)
    for t, works in ((105.0, True), (111.0, False), (124.0, False), (126.0, True)):
        flyer.t = t
        if works:
            assert rig.capture().left is not None
        else:
            with pytest.raises(CaptureError, match="no images"):
                rig.capture()


def test_a_dead_eye_delivers_nothing_and_a_dead_laser_no_spots(shape):
    frames = rig_of(shape, Flyer(shape), faults={"left_eye": {}}).capture()
    assert frames.left is None and frames.left_laser is None and frames.right is not None
    frames = rig_of(shape, Flyer(shape), faults={"right_eye": {}}).capture()
    assert frames.right is None and frames.right_laser is None and frames.left is not None
    frames = rig_of(shape, Flyer(shape), faults={"laser_off": {}}, camera={"noise": 0.0}).capture()
    assert np.array_equal(frames.left, frames.left_laser)


def test_a_grey_camera_delivers_grey_images(shape):
    frames = rig_of(shape, Flyer(shape), camera={"colour": False}).capture()
    assert frames.left.shape == frames.left_laser.shape == (256, 306)


def test_the_range_finder_meets_the_blade_the_ground_or_nothing(shape):
    world = World(shape, WorldSettings())
    flyer = Flyer(shape, station=20.0, distance=5.0)
    ahead = world.forward_range(flyer.position, np.array([0.0, 0.0, HEADING]))
    assert ahead == pytest.approx(5.0, abs=0.25)
    assert world.forward_range(flyer.position, np.array([0.0, 0.0, HEADING + np.pi])) is None
    low = np.array([0.0, 0.0, -10.0])
    down = world.forward_range(low, np.array([0.0, np.deg2rad(-60.0), 0.0]))
    assert down == pytest.approx(10.0 / np.sin(np.deg2rad(61.5)), abs=0.02)
    assert world.forward_range(np.array([0.0, 0.0, -60.0]), np.zeros(3)) is None
