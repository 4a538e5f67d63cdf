"""What the mission believes at its start: the turbine of the files, and how pictures from afar correct it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flight.turbine import Turbine
from vision.camera import Camera, LaserGrid, RigGeometry, StereoPair
from vision.capture import rotation_of

if TYPE_CHECKING:
    from mission.executive.perception import FarSight
    from mission.language.document import Mission
    from mission.language.rig_file import RigFile


def surveyed_turbine(mission: Mission) -> Turbine:
    """The turbine of the mission's turbine and site files, in local NED, with the site's uncertainty."""
    file, site = mission.turbine, mission.site
    lengths = (
        "root_diameter_m",
        "max_chord_m",
        "tip_chord_m",
        "tower_top_diameter_m",
        "tower_base_diameter_m",
        "nacelle_length_m",
        "nacelle_width_m",
    )
    return Turbine.surveyed(
        north_m=site.turbine_north_m,
        east_m=site.turbine_east_m,
        heading=np.deg2rad(site.turbine_heading_deg),
        hub_height_m=file.hub_height_m,
        overhang_m=file.overhang_m,
        blade_length_m=file.blade_length_m,
        root_radius_m=file.root_radius_m,
        azimuth=np.deg2rad(file.azimuth_deg) % (2 * np.pi),
        ground_m=site.ground_m,
        hub_sigma_m=site.position_sigma_m,
        heading_sigma=np.deg2rad(site.heading_sigma_deg),
        tilt=np.deg2rad(file.tilt_deg),
        cone=np.deg2rad(file.cone_deg),
        **{name: getattr(file, name) for name in lengths},
    )


def rig_geometry(rig: RigFile, folder: Path) -> RigGeometry:
    """Cameras and laser of a rig file; `folder` is where a camchain that it names is looked for.

    Raises:
        ValueError: the camchain cannot be read; one line for a person.
    """
    if rig.camchain is not None:
        from devices.camchain_file import read_camchain

        stereo = read_camchain(folder / rig.camchain)
    else:
        from mission.language.rig_file import CameraSection

        camera = rig.camera or CameraSection(width=640, height=512, focal_px=600.0, baseline_m=0.2)  # of no cameras
        lens = Camera(
            camera.width,
            camera.height,
            camera.focal_px,
            camera.focal_px,
            (camera.width - 1) / 2,
            (camera.height - 1) / 2,
            camera.distortion,
        )
        stereo = StereoPair(lens, lens, translation=np.array([0.0, -camera.baseline_m, 0.0]))
    return RigGeometry(stereo, None if rig.laser is None else _laser(rig), rig.bayer)


def _laser(rig: RigFile) -> LaserGrid:
    assert rig.laser is not None
    fan = float(np.deg2rad(rig.laser.fan_deg))
    roll, pitch, yaw = np.deg2rad(rig.laser.rotation_deg)
    return LaserGrid(
        rig.laser.rows,
        rig.laser.columns,
        (fan, fan),
        np.array(rig.laser.position_m),
        rotation_of(roll, pitch, yaw),
    )


def located(turbine: Turbine, camera: Camera, sights: Sequence[FarSight]) -> Turbine | None:
    """The turbine as several pictures from afar show it; None where they do not agree on a rotor.

    The blade to inspect is the one whose azimuth is nearest to what was believed.
    """
    from vision.triangulation import RotorBelief, locate_rotor

    belief = RotorBelief(
        turbine.hub, turbine.hub_sigma_m, turbine.heading, turbine.heading_sigma, turbine.tilt, turbine.cone
    )
    fix = locate_rotor([(sight.pose, sight.view) for sight in sights], camera, belief)
    if not fix.valid:
        return None
    return turbine.refined(
        hub=fix.hub.position,
        heading=fix.heading,
        azimuth=fix.azimuth_near(turbine.azimuth),
        hub_sigma_m=float(np.sqrt(np.linalg.eigvalsh(fix.hub.covariance)[-1])),
        heading_sigma=fix.heading_sigma,
        azimuth_sigma=fix.azimuth_sigma,
    )
