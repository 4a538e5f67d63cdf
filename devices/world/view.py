"""Pictures of the simulated world from one pose: four images of a cycle, and what is truly in them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from devices.world.laser import spots_on
from devices.world.lens import right_pose
from devices.world.motion import moved, smeared
from devices.world.renderer import Renderer
from devices.world.settings import WorldSettings
from devices.world.true_view import TrueView, true_view
from devices.world.turbine import TurbineShape
from vision.camera import Camera, RigGeometry
from vision.capture import CameraPose, Image, StereoFrames

_SECOND_EYE = ThreadPoolExecutor(1, "second eye")


def draw(
    renderer: Renderer,
    geometry: RigGeometry,
    pose: CameraPose,
    *,
    laser: bool = True,
    lit: bool = True,
    stamp_s: float = 0.0,
    frame: int = 0,
    shift: tuple[float, float] = (0.0, 0.0),
) -> StereoFrames:
    """Four images, two without `laser`, from the left camera's true pose. Two draws serve all four.

    lit: whether the laser shines in its images; a broken one does not. frame: number of the cycle, which chooses the
    noise. shift: by how many pixels the scene moves between the laser-off and the laser-on exposure; the spots move
    with the camera and stay where they are."""
    both = laser and geometry.laser is not None
    spots = spots_on(renderer.mesh, geometry, pose) if both and lit else None
    blur = renderer.settings.camera.motion_blur

    def look(eye: int, hand: Renderer, camera: Camera, place: CameraPose) -> tuple[Image, Image | None]:
        sensor = renderer.sensor(camera)
        off = smeared(sensor.darkened(hand.scenery(camera, place)), (shift[0] * blur, shift[1] * blur))
        on = None
        if both:
            on = moved(off, shift)
            if spots is not None:
                hand.add_laser(on, spots, camera, place, shift)
            on = sensor.exposed(on, 4 * frame + 2 + eye)
        return sensor.exposed(off, 4 * frame + eye), on

    stereo = geometry.stereo
    renderer.sensor(stereo.left), renderer.sensor(stereo.right)
    other = _SECOND_EYE.submit(look, 1, renderer.second, stereo.right, right_pose(geometry, pose))
    left, left_laser = look(0, renderer, stereo.left, pose)
    right, right_laser = other.result()
    return StereoFrames(stamp_s, left, right, left_laser, right_laser)


def render_view(
    shape: TurbineShape, settings: WorldSettings, geometry: RigGeometry, pose: CameraPose, laser: bool = True
) -> tuple[StereoFrames, TrueView]:
    """The images from one pose and what is truly in them. For many poses keep a `Renderer` and call `draw` and
    `true_view`."""
    renderer = Renderer(shape, settings)
    return draw(renderer, geometry, pose, laser=laser), true_view(renderer, geometry, pose)
