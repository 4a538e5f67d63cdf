"""Walls as a person stores them: lists of dots in JSON, or folders of pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from mission.cli.calibration_files import File, validated
from mission.cli.errors import CommandError
from mission.cli.stored_images import ENDINGS, read_image

if TYPE_CHECKING:
    from vision.calibration_laser import WallDots
    from vision.camera import LaserGrid, StereoPair
    from vision.capture import Image
    from vision.observation import Dots

Count = Annotated[int, Field(ge=0, le=1000)]


class Wall(File):
    """Dots on one wall: row, column, u, v of each, in both eyes."""

    left: list[tuple[Count, Count, float, float]]
    right: list[tuple[Count, Count, float, float]]


class WallFile(File):
    """Walls at several distances."""

    walls: list[Wall] = Field(min_length=1)


def read_walls(source: Path, laser: LaserGrid, stereo: StereoPair) -> list[WallDots]:
    """Dots from a JSON file, or from a folder with one folder of pictures a wall, as these cameras took them:
    left_laser and right_laser, and, for dots on a patterned wall, left and right beside them."""
    if source.is_dir():
        return _seen_walls(source, laser, stereo)
    walls = validated(WallFile, source).walls
    return [_common(wall.left, wall.right, laser, f"{source}: walls[{number}]") for number, wall in enumerate(walls)]


def _seen_walls(folder: Path, laser: LaserGrid, stereo: StereoPair) -> list[WallDots]:
    walls = []
    cameras = {"left": stereo.left, "right": stereo.right}
    for place in sorted(path for path in folder.iterdir() if path.is_dir()):
        sides = []
        for side, camera in cameras.items():
            dots = _whole_grid(place, side, laser, (camera.height, camera.width))
            sides.append(list(zip(dots.row.tolist(), dots.column.tolist(), *dots.uv.T.tolist(), strict=True)))
        walls.append(_common(sides[0], sides[1], laser, str(place)))
    if not walls:
        raise CommandError(f"{folder}: no folders of walls in it, one with left_laser.png and right_laser.png each")
    return walls


def _whole_grid(place: Path, side: str, laser: LaserGrid, size: tuple[int, int]) -> Dots:
    """The laser's dots on a wall in pictures of a size (h, w): all rows and columns must be in view, for nothing else
    numbers them."""
    from vision.single import grid_of

    lit = _named(place, f"{side}_laser")
    if lit is None:
        raise CommandError(f"{place}: {side}_laser.png is missing; a wall needs left_laser and right_laser")
    if lit.shape[:2] != size:
        raise CommandError(
            f"{place}: {side}_laser.png has {lit.shape[1]} x {lit.shape[0]} px, the camchain's camera {size[1]} x "
            f"{size[0]}; give the pictures as the camera took them"
        )
    dark = _named(place, side)
    if dark is not None:
        if dark.shape != lit.shape:
            raise CommandError(f"{place}: {side}.png and {side}_laser.png differ in size or colour")
        lit = np.asarray(np.clip(lit.astype(np.int16) - dark + 20, 0, 255), np.uint8)
    dots = grid_of(lit)
    seen = (0, 0) if dots is None else (int(dots.row.max()) + 1, int(dots.column.max()) + 1)
    if dots is None or seen != (laser.rows, laser.columns):
        raise CommandError(
            f"{place}: {side}_laser.png shows {seen[0]} rows and {seen[1]} columns of dots, the laser has {laser.rows} "
            f"and {laser.columns}; the whole grid must be in view (--rows, --columns say how large it is)"
        )
    return dots


def _named(place: Path, name: str) -> Image | None:
    path = next((place / f"{name}{end}" for end in ENDINGS if (place / f"{name}{end}").exists()), None)
    return None if path is None else read_image(path)


def _common(
    left: list[tuple[int, int, float, float]],
    right: list[tuple[int, int, float, float]],
    laser: LaserGrid,
    what: str,
) -> WallDots:
    """The dots of one wall that both eyes saw."""
    from vision.calibration_laser import WallDots

    one, other = ({(row, column): (u, v) for row, column, u, v in dots} for dots in (left, right))
    both = sorted(set(one) & set(other))
    beyond = next((dot for dot in both if dot[0] >= laser.rows or dot[1] >= laser.columns), None)
    if beyond is not None:
        raise CommandError(f"{what}: dot {beyond} lies outside a grid of {laser.rows} rows and {laser.columns} columns")
    index = np.array(both, np.int64).reshape(-1, 2)
    pixels = (np.array([side[dot] for dot in both], float).reshape(-1, 2) for side in (one, other))
    return WallDots(index[:, 0], index[:, 1], *pixels)
