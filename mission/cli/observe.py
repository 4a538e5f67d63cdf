"""Look for the blade in stored images: dots, distance, edges, tip."""

from __future__ import annotations

import json
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mission.cli.errors import CommandError

if TYPE_CHECKING:
    from vision.camera import RigGeometry
    from vision.capture import Image
    from vision.observation import BladeObservation, Dots, Edge

NAMES = ("left", "right", "left_laser", "right_laser")
ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")


def observe(
    images: Annotated[
        Path,
        typer.Argument(
            metavar="DIR|IMAGE",
            help="A folder with left.png right.png left_laser.png "
            "right_laser.png, or one photograph with the laser on.",
        ),
    ],
    rig: Annotated[
        Path | None, typer.Option(metavar="RIG", help="The rig file: cameras (or camchain) and laser.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print everything that was measured.")] = False,
    annotate: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Write the left image with what was seen.")
    ] = None,
) -> None:
    """Look for the blade in stored images.

    A folder with all four images and a rig give distance, surface, edges and tip. A single photograph with the laser
    on gives dots, edges and tip, also without a rig. Pixels are of the full left image; lines (theta, rho) are about
    its centre, theta clockwise from the right.

    \b
    Examples:
      mission observe frames/00012 --rig missions/rigs/simulated.yaml
      mission observe photograph.png --annotate seen.png
      mission observe frames/00012 --rig rig.yaml --json
    """
    found = _found(images)
    geometry = _geometry(rig) if rig is not None else None
    loaded = {name: _image(path) for name, path in found.items()}
    seen = _observed(images, loaded, geometry)
    if annotate is not None:
        _write(annotate, loaded["left_laser"], seen)
    if as_json:
        print(json.dumps(as_document(seen)))
        return
    for line in told(seen):
        print(line)


def _found(images: Path) -> dict[str, Path]:
    """The image files by name."""
    if images.is_file():
        return {"left_laser": images}
    if not images.is_dir():
        raise CommandError(f"{images}: no such folder or image")
    found = {}
    for name in NAMES:
        for ending in ENDINGS:
            if (images / f"{name}{ending}").is_file():
                found[name] = images / f"{name}{ending}"
                break
    if "left_laser" not in found:
        raise CommandError(
            f"{images}: holds no left_laser.png (and, for distances, left, right and right_laser beside it)"
        )
    return found


def _image(path: Path) -> Image:
    import cv2
    import numpy as np

    try:
        data = np.fromfile(path, np.uint8)
    except OSError as error:
        raise CommandError(f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    image = cv2.imdecode(data, cv2.IMREAD_ANYCOLOR) if len(data) else None
    if image is None:
        raise CommandError(f"{path}: not an image that can be read (PNG, JPEG, TIFF or BMP)")
    return np.asarray(image, np.uint8)


def _observed(images: Path, loaded: dict[str, Image], geometry: RigGeometry | None) -> BladeObservation:
    from vision.capture import StereoFrames
    from vision.pipeline import Eye, observe_single

    try:
        if geometry is None or "left" not in loaded:
            return observe_single(loaded["left_laser"], geometry, perf_counter)
        left, right, left_laser, right_laser = (loaded.get(name) for name in NAMES)
        frames = StereoFrames(0.0, left, right, left_laser, right_laser)
        return Eye(geometry, perf_counter).observe(frames)
    except ValueError as error:
        raise CommandError(f"{images}: {error}") from None


def _geometry(path: Path) -> RigGeometry:
    """Cameras and laser of a rig file; what else it says does not matter here."""
    from mission.executive.belief import rig_geometry
    from mission.language.document import MissionFileError
    from mission.language.rig_file import RigFile
    from mission.language.sources import Sources
    from mission.language.tree import Table
    from mission.language.typed import typed

    sources = Sources(path.parent)
    table = sources.read(path)
    if table is None:
        raise MissionFileError(sources.problems)
    entries = {key: entry for key, entry in table.entries.items() if key in ("camera", "camchain", "laser")}
    parts = typed(_seeing(), Table(entries, table.location, table.size), table.location, "rig", sources.problems)
    if parts is None:
        raise MissionFileError(sources.problems)
    if parts.camera is None and parts.camchain is None:
        raise CommandError(f"{path}: names no camera and no camchain, so its pixels cannot become metres")
    rig = RigFile.model_construct(kind="hardware", camera=parts.camera, camchain=parts.camchain, laser=parts.laser)
    try:
        return rig_geometry(rig, path.parent)
    except (ValueError, OSError) as error:
        raise CommandError(f"{path}: {error}") from None


def _seeing() -> Any:
    from mission.language.file_model import FileModel
    from mission.language.rig_file import CameraSection, LaserSection

    class Seeing(FileModel):
        """What the eye needs of a rig file."""

        camera: CameraSection | None = None
        camchain: str | None = None
        laser: LaserSection | None = None

    return Seeing


def _write(path: Path, image: Image, seen: BladeObservation) -> None:
    import cv2

    from vision.annotated import annotated

    done, data = cv2.imencode(path.suffix if path.suffix.lower() in ENDINGS else ".png", annotated(image, seen))
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
        lines.append(f"  tip       at {seen.tip.point[0]:.0f}, {seen.tip.point[1]:.0f} px from the image centre")
    if seen.heading is not None:
        lines.append(f"  heading   {np.rad2deg(seen.heading):.2f}°")
    if seen.chord_m is not None:
        lines.append(f"  chord     {seen.chord_m:.3f} ± {seen.chord_sigma_m:.3f} m")
    return [*lines, f"  {seen.elapsed_ms.get('total', 0.0):.1f} ms"]


def as_document(seen: BladeObservation) -> dict[str, Any]:
    """The observation as JSON: angles in degrees, pixels of the full image, metres in the camera frame."""
    import numpy as np

    def degrees(angle: float | None) -> float | None:
        return None if angle is None else float(np.rad2deg(angle))

    def listed(array: Any) -> list[Any] | None:
        return None if array is None else list(np.asarray(array, float).tolist())

    return {
        "valid": seen.valid,
        "reasons": list(seen.reasons),
        "dots": {"left": _dots(seen.dots_left), "right": _dots(seen.dots_right)},
        "matches": [] if seen.matches is None else [{"row": r, "column": c} for r, c in seen.matches.tolist()],
        "points_m": listed(seen.points) or [],
        "sigma_m": listed(seen.sigma_m) or [],
        "distance_m": seen.distance_m,
        "distance_sigma_m": seen.distance_sigma_m,
        "nearest_m": seen.nearest_m,
        "normal": listed(seen.normal),
        "edges": [_edge(edge) for edge in seen.edges],
        "tip": None
        if seen.tip is None
        else {
            "theta_deg": degrees(seen.tip.line.theta),
            "rho_px": seen.tip.line.rho,
            "point_px": listed(seen.tip.point),
            "sigma_px": seen.tip.sigma_px,
        },
        "heading_deg": degrees(seen.heading),
        "heading_sigma_deg": degrees(seen.heading_sigma),
        "chord_m": seen.chord_m,
        "chord_sigma_m": seen.chord_sigma_m,
        "sharpness": seen.sharpness,
        "exposure": seen.exposure,
        "elapsed_ms": dict(seen.elapsed_ms),
    }


def _dots(dots: Dots | None) -> list[dict[str, float | int]]:
    if dots is None:
        return []
    return [
        {"u": float(u), "v": float(v), "row": int(row), "column": int(column)}
        for (u, v), row, column in zip(dots.uv, dots.row, dots.column, strict=True)
    ]


def _edge(edge: Edge) -> dict[str, Any]:
    import numpy as np

    return {
        "theta_deg": float(np.rad2deg(edge.line.theta)),
        "rho_px": edge.line.rho,
        "sigma_theta_deg": float(np.rad2deg(edge.sigma_theta)),
        "sigma_rho_px": edge.sigma_rho_px,
        "outward": edge.outward.tolist(),
        "support": edge.support,
        "ends_px": edge.ends.tolist(),
    }
