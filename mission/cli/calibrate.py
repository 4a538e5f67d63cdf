"""Calibrate the stereo cameras from a chessboard, or the laser from walls."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Fit(StrEnum):
    """Which fit the result is built on."""

    AUTO = "auto"
    FREE = "free"
    HELD = "held"


def calibrate(
    source: Annotated[
        Path,
        typer.Argument(metavar="SOURCE", help="Folder of pictures, or a .json file of corners (of dots with --laser)."),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE", help="The camchain to write.")] = Path(
        "camchain.yaml"
    ),
    report: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write calibration.html, calibration.txt and coverage.png there.")
    ] = None,
    board: Annotated[str, typer.Option(metavar="CxR", help="Inner corners of the board, across x down.")] = "9x6",
    square_mm: Annotated[float | None, typer.Option(min=0.1, max=10000, help="Length of one square.")] = None,
    focal_mm: Annotated[
        float | None, typer.Option(min=0.1, max=2000, help="Nominal focal length of the lenses.")
    ] = None,
    pixel_um: Annotated[float | None, typer.Option(min=0.1, max=100, help="Size of a pixel.")] = None,
    baseline_mm: Annotated[float | None, typer.Option(min=1, max=5000, help="Nominal distance of the lenses.")] = None,
    fit: Annotated[
        Fit,
        typer.Option(
            help="free: fit the focal lengths. held: keep the nominal one. auto: free unless badly conditioned."
        ),
    ] = Fit.AUTO,
    laser: Annotated[bool, typer.Option("--laser", help="Calibrate the laser; --camchain says which cameras.")] = False,
    camchain: Annotated[Path | None, typer.Option(metavar="FILE", help="With --laser: the cameras.")] = None,
    rows: Annotated[int, typer.Option(min=2, max=101, help="With --laser: dots from top to bottom.")] = 11,
    columns: Annotated[int, typer.Option(min=2, max=101, help="With --laser: dots from left to right.")] = 11,
    fan_deg: Annotated[
        float, typer.Option(min=1, max=120, help="With --laser: nominal full angle of the grid.")
    ] = 28.2,
) -> None:
    """Calibrate the cameras and write them as a Kalibr camchain, or calibrate the laser and print it for the rig file.

    Pictures of the board come in pairs: left/NAME.png and right/NAME.png, or left_NAME.png and right_NAME.png. Ten to
    thirty pairs, the board tilted by 15 to 45 degrees and brought into every corner. Data that cannot carry the focal
    lengths are called so, and the nominal lens is held instead when it is known (--focal-mm and --pixel-um).

    For the laser, SOURCE holds one folder for each wall, with left_laser and right_laser pictures that show the whole
    grid (and left and right, the laser off, where the wall is patterned), at two or more distances.

    \b
    Examples:
      mission calibrate boards/ --board 9x6 --square-mm 60 --out rig/camchain.yaml --report rig/
      mission calibrate corners.json --focal-mm 8.5 --pixel-um 3.45 --baseline-mm 50
      mission calibrate walls/ --laser --camchain rig/camchain.yaml
    """
    from mission.cli.errors import CommandError
    from vision.calibration_fit import CalibrationError
    from vision.camchain import CamchainError

    try:
        if laser:
            _laser(source, camchain, rows, columns, fan_deg, report)
        else:
            _stereo(source, out, report, board, square_mm, (focal_mm, pixel_um, baseline_mm), fit)
    except CalibrationError as error:
        raise CommandError(f"{source}: {error}") from None
    except CamchainError as error:
        raise CommandError(str(error)) from None


def _stereo(
    source: Path,
    out: Path,
    report: Path | None,
    board: str,
    square_mm: float | None,
    sheet: tuple[float | None, float | None, float | None],
    fit: Fit,
) -> None:
    from dataclasses import replace

    import cv2

    from devices.camchain_file import write_camchain
    from mission.cli.calibration_files import DataSheet, find_boards, nominal_of, read_corners
    from vision.calibration import calibrate_stereo
    from vision.calibration_report import coverage_picture, stereo_text

    cv2.setNumThreads(1)  # or ill-conditioned sums end differently from run to run
    unused: list[str] = []
    given = DataSheet()
    if source.is_dir():
        views, unused = find_boards(source, board)
    else:
        views, given = read_corners(source)
    if square_mm is not None:
        views = replace(views, square_m=square_mm / 1000)
    found = calibrate_stereo(views, nominal_of(given, *sheet), fit.value)
    text = stereo_text(found, unused)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_camchain(out, found.stereo)
    if report is not None:
        from mission.cli.calibration_page import page

        report.mkdir(parents=True, exist_ok=True)
        (report / "calibration.txt").write_text(text, "utf-8")
        picture = cv2.imencode(".png", coverage_picture(found))[1].tobytes()
        (report / "coverage.png").write_bytes(picture)
        (report / "calibration.html").write_text(page(found, text, picture), "utf-8")
    print(text, end="")
    print(f"\nwritten to {out}" + (f", report in {report}" if report is not None else ""))


def _laser(source: Path, camchain: Path | None, rows: int, columns: int, fan_deg: float, report: Path | None) -> None:
    import numpy as np

    from devices.camchain_file import read_camchain
    from mission.cli.errors import CommandError
    from mission.cli.wall_files import read_walls
    from vision.calibration_laser import fit_laser
    from vision.calibration_report import laser_text
    from vision.camera import LaserGrid

    if camchain is None:
        raise CommandError("--laser needs --camchain: calibrate the cameras first")
    stereo = read_camchain(camchain)
    fan = float(np.deg2rad(fan_deg))
    nominal = LaserGrid(rows, columns, (fan, fan))
    text = laser_text(fit_laser(read_walls(source, nominal, stereo), stereo, nominal))
    if report is not None:
        report.mkdir(parents=True, exist_ok=True)
        (report / "laser.txt").write_text(text, "utf-8")
    print(text, end="")
