"""Camchain files on disk, as Kalibr and `mission calibrate` write them."""

from __future__ import annotations

from pathlib import Path

from vision.camchain import CamchainError, format_camchain, parse_camchain
from vision.camera import StereoPair

LARGEST_FILE = 65536


def read_camchain(path: Path) -> StereoPair:
    """The stereo pair of a camchain file.

    Raises:
        CamchainError: it cannot be read, or says something impossible.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise CamchainError(f"{path}: {path.stat().st_size} bytes is too large for a camchain")
        text = path.read_text("utf-8")
    except OSError as error:
        raise CamchainError(f"{path}: {(error.strerror or str(error)).lower()}") from None
    except UnicodeDecodeError:
        raise CamchainError(f"{path}: not a text file") from None
    return parse_camchain(text, str(path))


def write_camchain(path: Path, stereo: StereoPair) -> None:
    """Write a camchain file, whole or not at all."""
    draft = path.with_name(path.name + ".part")
    draft.write_text(format_camchain(stereo), "utf-8")
    draft.replace(path)
