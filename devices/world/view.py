"""Pictures of the simulated world from one pose: four images of a cycle, and what is truly in them."""

from __future__ import annotations

from devices.world.laser import spots_on
from devices.world.lens import right_pose
from devices.world.motion import moved, smeared
from devices.world.renderer import Renderer
from devices.world.settings import WorldSettings
from devices.world.true_view import TrueView, true_view
from devices.world.turbine import TurbineShape
from vision.camera import RigGeometry
from vision.capture import CameraPose, Image, StereoFrames


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
    images: list[Image | None] = []
    both = laser and geometry.laser is not None
    spots = spots_on(renderer.mesh, geometry, pose) if both and lit else None
    blur = renderer.settings.camera.motion_blur
    for eye, camera in enumerate((geometry.stereo.left, geometry.stereo.right)):
        place = pose if eye == 0 else right_pose(geometry, pose)
        sensor = renderer.sensor(camera)
        off = smeared(sensor.darkened(renderer.scenery(camera, place)), (shift[0] * blur, shift[1] * blur))
        on = None
        if both:
            on = moved(off, shift)
            if spots is not None:
                renderer.add_laser(on, spots, camera, place, shift)
            on = sensor.exposed(on, 4 * frame + 2 + eye)
        images += [sensor.exposed(off, 4 * frame + eye), on]
    return StereoFrames(stamp_s, images[0], images[2], images[1], images[3])


def render_view(
    shape: TurbineShape, settings: WorldSettings, geometry: RigGeometry, pose: CameraPose, laser: bool = True
) -> tuple[StereoFrames, TrueView]:
    """The images from one pose and what is truly in them. For many poses keep a `Renderer` and call `draw` and
    `true_view`."""
    renderer = Renderer(shape, settings)
    return draw(renderer, geometry, pose, laser=laser), true_view(renderer, geometry, pose)
