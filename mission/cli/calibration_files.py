"""Boards as a person stores them: lists of corners in JSON, or folders of pictures."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mission.cli.errors import CommandError
from mission.cli.stored_images import ENDINGS, read_image

if TYPE_CHECKING:
    from vision.board import BoardViews
    from vision.calibration_fit import Nominal

T = TypeVar("T", bound=BaseModel)

LARGEST_FILE = 64 * 1024 * 1024

Point = tuple[float, float]


class File(BaseModel):
    """A file of JSON; keys that it has besides do not matter."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)


class DataSheet(File):
    """What the lens and the rig were sold as."""

    focal_length_mm: float | None = Field(None, gt=0.1, le=2000)
    pixel_um: float | None = Field(None, gt=0.1, le=100)
    baseline_mm: float | None = Field(None, gt=1, le=5000)


class CornerFile(File):
    """Corners of one board: for each view the same corners in the same order, null where a camera did not see the
    board."""

    image_size: tuple[Annotated[int, Field(ge=16, le=20000)], Annotated[int, Field(ge=16, le=20000)]]
    object_points: list[tuple[float, float, float]] = Field(min_length=6)
    left: list[list[Point] | None]
    right: list[list[Point] | None]
    square_mm: float | None = Field(None, gt=0.1, le=10000)
    nominal: DataSheet = DataSheet()


def read_corners(path: Path) -> tuple[BoardViews, DataSheet]:
    """Corners from a JSON file, with the data sheet that it carries."""
    from vision.board import BoardViews

    file = validated(CornerFile, path)
    count = len(file.object_points)
    if len(file.left) != len(file.right):
        raise CommandError(f"{path}: left has {len(file.left)} views and right {len(file.right)}; both need the same")
    for side in ("left", "right"):
        for number, view in enumerate(getattr(file, side)):
            if view is not None and len(view) != count:
                raise CommandError(f"{path}: {side}[{number}] has {len(view)} corners, object_points has {count}")
            width, height = file.image_size
            for u, v in view or ():
                if not (-1 <= u <= width and -1 <= v <= height):
                    raise CommandError(
                        f"{path}: {side}[{number}] has a corner at ({u:g}, {v:g}), outside an image_size of "
                        f"{width} x {height}"
                    )
    square = None if file.square_mm is None else file.square_mm / 1000
    sides = [tuple(None if view is None else np.array(view) for view in side) for side in (file.left, file.right)]
    return BoardViews(file.image_size, np.array(file.object_points), sides[0], sides[1], square), file.nominal


def find_boards(folder: Path, board: str) -> tuple[BoardViews, list[str]]:
    """Corners of a board (`9x6`: inner corners across and down) in a folder's pictures, left/NAME and right/NAME, or
    left_NAME and right_NAME; and of the pictures that cannot be used, which and why."""
    from vision.board import BoardViews, board_points, find_corners, turned_alike

    columns, rows = _board_size(board)
    pairs, unused = _pairs(folder)
    looked: dict[str, list[tuple[tuple[int, ...], NDArray[np.float64] | None]]] = {}
    for name, paths in pairs.items():
        try:
            images = [read_image(path) for path in paths]
        except CommandError as error:
            unused.append(str(error))
            continue
        looked[name] = [(image.shape[1::-1], find_corners(image, columns, rows)) for image in images]
    sizes = Counter(size for pair in looked.values() for size, _ in pair)
    if not sizes:
        raise CommandError(f"{folder}: no pair of pictures that can be read: {unused[0]}")
    size, count = sizes.most_common(1)[0]
    if 2 * len(looked) - count > len(looked) // 3:
        raise CommandError(
            f"{folder}: pictures of {' and '.join(f'{w} x {h}' for w, h in sorted(sizes))} px; "
            "give those of both cameras as they took them, of one size"
        )
    names, left, right = [], [], []
    for name, ((one_size, one), (other_size, other)) in looked.items():
        odd = one_size if one_size != size else other_size
        if odd != size:
            unused.append(f"{name}: {odd[0]} x {odd[1]} px, the others are {size[0]} x {size[1]}")
            continue
        names.append(name)
        left.append(one)
        right.append(other if one is None or other is None else turned_alike(one, other, columns, rows))
    seen = [sum(corners is not None for corners in side) for side in (left, right)]
    if min(seen) == 0:
        raise CommandError(
            f"{folder}: no board of {columns} x {rows} inner corners found "
            f"({seen[0]} of {len(names)} left, {seen[1]} right pictures); is --board right?"
        )
    views = BoardViews((size[0], size[1]), board_points(columns, rows), tuple(left), tuple(right), None, tuple(names))
    return views, unused


def nominal_of(sheet: DataSheet, focal_mm: float | None, pixel_um: float | None, baseline_mm: float | None) -> Nominal:
    """The data sheet with what the command line says instead."""
    from vision.calibration_fit import Nominal

    focal, pixel = focal_mm or sheet.focal_length_mm, pixel_um or sheet.pixel_um
    baseline = baseline_mm or sheet.baseline_mm
    if (focal is None) != (pixel is None):
        raise CommandError("the nominal focal length needs both --focal-mm and --pixel-um")
    focal_px = focal / pixel * 1000 if focal is not None and pixel is not None else None
    return Nominal(focal_px, None if baseline is None else baseline / 1000)


def validated(model: type[T], path: Path) -> T:
    """What a JSON file says; raises CommandError with the first thing in it that is wrong."""
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise CommandError(f"{path}: too large")
        return model.model_validate_json(path.read_bytes())
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "the file"
        raise CommandError(f"{path}: {place}: {first['msg'][:1].lower()}{first['msg'][1:]}") from None


def _board_size(text: str) -> tuple[int, int]:
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdigit() and 3 <= int(part) <= 100 for part in parts):
        raise CommandError(f"--board {text!r}: inner corners across x down, as in 9x6")
    return int(parts[0]), int(parts[1])


def _pairs(folder: Path) -> tuple[dict[str, tuple[Path, Path]], list[str]]:
    """Left and right pictures by the name that they share, and what is said of those without a partner."""
    if not folder.is_dir():
        raise CommandError(f"{folder}: neither a folder of pictures nor a .json file of corners")
    found: dict[str, dict[str, Path]] = {"left": {}, "right": {}}
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in ENDINGS:
            continue
        for side, names in found.items():
            if path.parent.name == side:
                names[path.stem] = path
            elif path.stem.startswith(side):
                names[path.stem[len(side) :].lstrip("_-")] = path
    left, right = found.values()
    both = sorted(set(left) & set(right))
    if not both:
        raise CommandError(f"{folder}: no pairs of pictures: left/NAME and right/NAME, or left_NAME and right_NAME")
    alone = [
        f"{path}: no {other} picture of that name"
        for names, partners, other in ((left, right, "right"), (right, left, "left"))
        for name, path in names.items()
        if name not in partners
    ]
    return {name: (left[name], right[name]) for name in both}, alone
