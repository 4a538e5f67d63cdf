"""Look for the blade in stored images: dots, distance, edges, tip."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from mission.cli.errors import CommandError

if TYPE_CHECKING:
    from vision.camera import RigGeometry
    from vision.capture import Image
    from vision.observation import BladeObservation

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def observe(
    images: Annotated[
        Path,
        typer.Argument(
            metavar="DIR|IMAGE",
            help="A folder with left.png right.png left_laser.png "
            "right_laser.png or some of them, or one photograph with the laser on.",
        ),
    ],
    rig: Annotated[
        Path | None, typer.Option(metavar="RIG", help="The rig file: camchain (or camera) and laser. For distances.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything that was measured.")] = False,
    annotate: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Write the left image with what was seen.")
    ] = None,
) -> None:
    """Look for the blade in stored images.

    left_laser is always needed. It gives dots, edges and tip by itself, also without a rig. With a rig, right_laser
    adds distance and surface, and left and right (the laser off) make the dots surer. Images are PNG, JPEG, TIFF or
    BMP, grey or colour.

    Pixels are of the full left image. Lines (theta, rho) are about its centre: theta is the direction of the normal,
    clockwise from the right, rho its length. Points are in metres: forward, right, down of the left lens.

    A rig file for this needs no more than

    \b
      camchain: camchain.yaml        # of Kalibr, or of mission calibrate
      laser: {rows: 11, columns: 11, fan_deg: 28.2, position_m: [0.0, 0.10, -0.06]}

    \b
    Examples:
      mission observe frames/00012 --rig missions/rigs/simulated.yaml
      mission observe photograph.png --annotate seen.png
      mission observe frames/00012 --rig rig.yaml --json
    """
    from mission.cli import observation_json
    from mission.cli.rig_of_eye import geometry_of
    from mission.cli.stored_images import check_sizes, found_images, read_images

    if annotate is not None and annotate.suffix.lower() not in PICTURES:
        raise CommandError(f"--annotate {annotate}: a picture's name ends in .png or .jpg")
    found = found_images(images)
    geometry = geometry_of(rig) if rig is not None else None
    loaded = read_images(found)
    check_sizes(found, loaded, geometry)
    observed(loaded, geometry)  # compiled loops are loaded on the way, which is no part of the time that is told
    seen = observed(loaded, geometry)
    if annotate is not None:
        _write(annotate, loaded["left_laser"], seen)
    if as_json:
        print(observation_json.as_json(seen))
        return
    for line in told(seen):
        print(line)


def observed(images: dict[str, Image], geometry: RigGeometry | None) -> BladeObservation:
    """What the images show: with the rig's eye where they and the rig allow it, or else as a single photograph."""
    from mission.cli.stored_images import NAMES
    from vision.capture import StereoFrames
    from vision.pipeline import Eye, observe_single

    if geometry is None or geometry.laser is None:
        return observe_single(images["left_laser"], geometry, perf_counter)
    left, right, left_laser, right_laser = (images.get(name) for name in NAMES)
    seen = Eye(geometry, perf_counter).observe(StereoFrames(0.0, left, right, left_laser, right_laser))
    if not seen.valid and set(images) == {"left_laser"}:
        return observe_single(images["left_laser"], geometry, perf_counter)
    return seen


def _write(path: Path, image: Image, seen: BladeObservation) -> None:
    import cv2

    from vision.annotated import annotated

    done, data = cv2.imencode(path.suffix.lower(), annotated(image, seen))
    try:
        path.write_bytes(data.tobytes() if done else b"")
    except OSError as error:
        raise CommandError(f"{path}: {(error.strerror or 'cannot be written').lower()}") from None


def told(seen: BladeObservation) -> list[str]:
    """What a person reads."""
    import numpy as np

    left = 0 if seen.dots_left is None else len(seen.dots_left)
    lines = [f"{'valid' if seen.valid else 'refused'}: {left} dots" + "".join(f"; {reason}" for reason in seen.reasons)]
    if seen.distance_m is not None:
        lines.append(
            f"  distance  {seen.distance_m:.3f} ± {seen.distance_sigma_m:.3f} m, nearest {seen.nearest_m:.3f} m"
        )
    lines.extend(
        f"  edge      θ {np.rad2deg(edge.line.theta):7.2f} ± {np.rad2deg(edge.sigma_theta):.2f}°"
        f"  ρ {edge.line.rho:7.1f} ± {edge.sigma_rho_px:.1f} px"
        for edge in seen.edges
    )
    if seen.tip is not None:
        tip = seen.tip
        lines.append(
            f"  tip       θ {np.rad2deg(tip.line.theta):7.2f}°  ρ {tip.line.rho:7.1f} px,"
            f" at {tip.point[0]:.0f}, {tip.point[1]:.0f} px from the image centre"
        )
    if seen.heading is not None:
        lines.append(f"  heading   {np.rad2deg(seen.heading):.2f}°")
    if seen.chord_m is not None:
        lines.append(f"  chord     {seen.chord_m:.3f} ± {seen.chord_sigma_m:.3f} m")
    return [*lines, f"  {seen.elapsed_ms.get('total', 0.0):.1f} ms"]
