"""Images as `mission observe` and `mission calibrate` are given them: one file, or a folder with named ones."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mission.cli.errors import CommandError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from vision.camera import RigGeometry
    from vision.capture import Image

NAMES = ("left", "right", "left_laser", "right_laser")
ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
LEAST_SIDE, LARGEST_BYTES = 32, 512 * 1024 * 1024


def found_images(source: Path) -> dict[str, Path]:
    """The files of one observation by name; a single file is the left image with the laser on."""
    if source.is_file():
        return {"left_laser": source}
    if not source.is_dir():
        raise CommandError(f"{source}: no such folder or image")
    found = {}
    for name in NAMES:
        for ending in ENDINGS:
            if (source / f"{name}{ending}").is_file():
                found[name] = source / f"{name}{ending}"
                break
    if "left_laser" not in found:
        raise CommandError(
            f"{source}: holds no left_laser.png (and, for distances, left, right and right_laser beside it)"
        )
    return found


def read_image(path: Path) -> Image:
    """An image (h, w) or (h, w, 3) BGR of 8 bits, as the camera took it: deeper ones are brought to 8 bits, alpha is
    left out, a grey image stored in colour is grey."""
    image = _stored(path)
    return _of_eight_bits(image, _bits(image))


def read_images(found: dict[str, Path]) -> dict[str, Image]:
    """The images of one observation: all in colour, or all grey where one of them is; deeper ones are brought to 8
    bits, all alike."""
    import cv2
    import numpy as np

    stored = {name: _stored(path) for name, path in found.items()}
    bits = max(_bits(image) for image in stored.values())
    images = {name: _of_eight_bits(image, bits) for name, image in stored.items()}
    if any(image.ndim == 2 for image in images.values()):
        images = {
            name: image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
            for name, image in images.items()
        }
    return images


def _stored(path: Path) -> NDArray[Any]:
    """An image (h, w) or (h, w, 3) BGR of 8 or 16 bits as it lies in the file."""
    import cv2
    import numpy as np

    try:
        size = path.stat().st_size
        data = np.fromfile(path, np.uint8) if size <= LARGEST_BYTES else None
    except OSError as error:
        raise CommandError(f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    if data is None:
        raise CommandError(f"{path}: {size >> 20} MB is too large for an image; give one frame of a camera")
    try:
        flags = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
        with _muted():
            image = cv2.imdecode(data, flags) if len(data) else None
    except cv2.error:
        image = None
    if image is None:
        raise CommandError(f"{path}: not an image that can be read (PNG, JPEG, TIFF or BMP)")
    if image.dtype not in (np.uint8, np.uint16):
        raise CommandError(f"{path}: its pixels are {image.dtype}; 8 or 16 bits are read")
    if min(image.shape[:2]) < LEAST_SIDE:
        raise CommandError(
            f"{path}: {image.shape[1]} × {image.shape[0]} pixels are too few; give the camera's own picture"
        )
    if image.ndim == 3 and all(np.array_equal(image[..., 0], image[..., k]) for k in (1, 2)):
        image = image[..., 0]
    return np.ascontiguousarray(image)


@contextmanager
def _muted() -> Iterator[None]:
    """Nothing is written to standard error: what libraries say of a broken file there is said by an error of ours."""
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with Path(os.devnull).open("w") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _bits(image: NDArray[Any]) -> int:
    """8, or of how many bits a camera filled the lower part of 16: 10, 12, 14 or all."""
    if image.dtype.itemsize == 1:
        return 8
    return next((bits for bits in (10, 12, 14) if int(image.max()) < 1 << bits), 16)


def _of_eight_bits(image: NDArray[Any], bits: int) -> Image:
    import numpy as np

    deep = image.dtype.itemsize == 2
    return np.ascontiguousarray(image >> (max(bits, 10) - 8) if deep else image, np.uint8)


def check_sizes(found: dict[str, Path], images: dict[str, Image], geometry: RigGeometry | None) -> None:
    """Refuse images that are not of the rig's cameras, or not of one size without a rig."""
    first = next(iter(images.values()))
    for name, image in images.items():
        height, width = first.shape[:2]
        whose, remedy = "the others are", "give images of one moment as the cameras took them"
        if geometry is not None:
            camera = geometry.stereo.right if name.startswith("right") else geometry.stereo.left
            width, height = camera.width, camera.height
            whose = "the rig's camera has"
            remedy = "give them as the camera took them, or the rig that took them"
        if image.shape[:2] != (height, width):
            raise CommandError(
                f"{found[name]}: {image.shape[1]} × {image.shape[0]} pixels, {whose} {width} × {height}; {remedy}"
            )
