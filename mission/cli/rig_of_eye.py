"""What the eye needs of a rig file: cameras and laser; what else it says about flying does not matter here."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mission.cli.errors import CommandError

if TYPE_CHECKING:
    from vision.camera import RigGeometry

EXAMPLE = "camchain: camchain.yaml and laser: {rows: 11, columns: 11, fan_deg: 28.2, position_m: [0, 0.1, -0.06]}"


def geometry_of(path: Path) -> RigGeometry:
    """Cameras and laser of a rig file.

    Raises: CommandError, MissionFileError: with the file, the line and what would be right.
    """
    from mission.executive.belief import rig_geometry
    from mission.language.diagnostics import Diagnostic, near_or_choices
    from mission.language.document import MissionFileError
    from mission.language.rig_file import RigFile
    from mission.language.sources import Sources
    from mission.language.tree import Table
    from mission.language.typed import typed

    sources = Sources(path.parent)
    table = sources.read(path)
    if table is None:
        raise MissionFileError(sources.problems)
    entries = {key: entry for key, entry in table.entries.items() if key in ("camera", "camchain", "laser", "bayer")}
    known = [*RigFile.model_fields, "world"]
    for key, entry in table.entries.items():
        if key not in known:
            hint = near_or_choices(key, known)
            sources.problems.append(Diagnostic(entry.key, "M202", f"rig has no {key!r}", hint))
    parts = typed(_seeing(), Table(entries, table.location, table.size), table.location, "rig", sources.problems)
    if parts is None or sources.problems:
        raise MissionFileError(sources.problems)
    if parts.camera is None and parts.camchain is None:
        raise CommandError(
            f"{path}: names no camera and no camchain, so its pixels cannot become metres; say {EXAMPLE}"
        )
    rig = RigFile.model_construct(kind="hardware", **dict(parts))
    try:
        return rig_geometry(rig, path.parent)
    except (ValueError, OSError) as error:
        raise CommandError(f"{path}: {error}") from None


def _seeing() -> Any:
    from mission.language.file_model import FileModel
    from mission.language.rig_file import CameraSection, LaserSection
    from vision.camera import Bayer

    class Seeing(FileModel):
        """What the eye needs of a rig file."""

        camera: CameraSection | None = None
        camchain: str | None = None
        laser: LaserSection | None = None
        bayer: Bayer | None = None

    return Seeing
